// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/palette.h"

namespace semrover {

std::optional<uint8_t> class_of_name(std::string_view name)
{
    for (uint8_t i = 0; i < kClassCount; ++i)
        if (kPalette[i].name == name)
            return i;
    return std::nullopt;
}

} // namespace semrover
