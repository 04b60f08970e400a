// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace semrover {

// the class that a material's name stands for: a class name, in any case, with '_', '-' and ' ' alike, alone or in
// front of something that is no letter ("Traffic_Light", "building.003", "road-lane 2"); the longest one that fits
std::optional<uint8_t> class_of_material(std::string_view name);

} // namespace semrover
