// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/palette.h"

#include <algorithm>

namespace semrover {

namespace {

char plain(char c)
{
    if (c == '_' || c == '-')
        return ' ';
    return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
}

} // namespace

bool same_class_name(std::string_view a, std::string_view b)
{
    return std::ranges::equal(a, b, {}, plain, plain);
}

std::optional<uint8_t> class_of_name(std::string_view name)
{
    for (uint8_t i = 0; i < kClassCount; ++i)
        if (same_class_name(kPalette[i].name, name))
            return i;
    return std::nullopt;
}

} // namespace semrover
