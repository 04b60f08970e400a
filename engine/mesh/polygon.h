// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace semrover {

// A polygon as triangles of its corners (numbers from 0), corners - 2 of them: a fan from corner 0 where it is convex,
// else by cutting ears off (Meisters 1975); a fan again for more than 256 corners, or where no ear is found.
std::vector<std::array<uint32_t, 3>> triangulated(std::span<const std::array<float, 3>> corners);

} // namespace semrover
