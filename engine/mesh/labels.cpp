// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/labels.h"

#include "engine/scene/palette.h"

namespace semrover {

namespace {

char folded(char c)
{
    if (c == '_' || c == '-')
        return ' ';
    return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
}

bool is_letter(char c)
{
    return c >= 'a' && c <= 'z';
}

// does `name` start with `prefix`, and does a word end there?
bool starts_with_word(std::string_view name, std::string_view prefix)
{
    if (name.size() < prefix.size())
        return false;
    for (size_t i = 0; i < prefix.size(); ++i)
        if (folded(name[i]) != folded(prefix[i]))
            return false;
    return name.size() == prefix.size() || !is_letter(folded(name[prefix.size()]));
}

} // namespace

std::optional<uint8_t> class_of_material(std::string_view name)
{
    std::optional<uint8_t> found;
    for (uint8_t i = 0; i < kClassCount; ++i)
        if (starts_with_word(name, kPalette[i].name) &&
            (!found || kPalette[i].name.size() > kPalette[*found].name.size()))
            found = i;
    return found;
}

} // namespace semrover
