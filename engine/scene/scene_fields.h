// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"

#include <array>
#include <cmath>
#include <span>

namespace semrover {

// Fields that files of things in a scene share (objects, actors). Errors: bad_input, with `where` and the key in front

// The number of a thing in pictures of instances, of 16 bits; 0 is nothing
constexpr uint32_t kMostInstances = 65535;
inline uint32_t instance_number(uint32_t id)
{
    return id + 1;
}

constexpr double kFarthestThing = 1e6, kShortestSide = 1e-3, kLongestSide = 1e4; // metres: of places, of sides of boxes

// The list of a file {"format": .., "version": 1, NAME: [..]} with these keys, of at most `most` things
Result<const Json*> things_in(const Json& file, const char* format, std::span<const std::string_view> keys,
                              const char* name, size_t most, std::string_view where);
Result<uint32_t> id_at(const Json& thing, std::string_view where);   // "id"
Result<uint8_t> class_at(const Json& thing, std::string_view where); // "class": a name of the palette
// three numbers from `low` to `high`
Result<std::array<double, 3>> triple_at(const Json& thing, const char* key, double low, double high,
                                        std::string_view where);

// to a whole number of parts, `per_unit` of which make one; never -0
inline double rounded_to(double value, double per_unit)
{
    return std::round(value * per_unit) / per_unit + 0.0;
}
constexpr double kPerMetre = 1e4; // lengths are written to 0.1 mm

} // namespace semrover
