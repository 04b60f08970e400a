// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/palette.h"
#include "runtime/base/json.h"

#include <optional>
#include <vector>

namespace semrover {

// How things of a class usually are, as a model has seen them: size in metres (along the heading, across it, up) and
// colours, sRGB 0..1. Without a size things of the class have no boxes.
struct UsualParts {
    std::array<double, 3> size{};
    std::array<double, 2> pitch{}; // metres from middle to middle: across the front, up
    double low = 0;                // metres from the ground to the lower edge of the lowest
    std::vector<std::array<double, 3>> tints;
};
struct UsualObject {
    std::array<double, 3> size{};
    std::vector<std::array<double, 3>> tints;
    std::optional<UsualParts> parts = {}; // of fronts that look at a street: windows

    bool known() const { return size[0] > 0; }
};
using UsualObjects = std::array<UsualObject, kClassCount>; // by label

// {"car": {"size": [4.6, 2.1, 1.5], "tints": ["#7a1f1c", ...]}, ...} (docs/models.md §8). Errors: bad_input with the
// class, for classes that there are not, sizes and distances outside 1 mm to 1 km, more than 4096 tints.
Result<UsualObjects> parse_usual_objects(const Json& json, std::string_view where);

} // namespace semrover
