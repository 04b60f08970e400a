// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace semrover {

constexpr size_t kMaxFaceCorners = 1 << 16; // of a polygon in a file; readers refuse more

// A polygon as triangles of its corners (numbers from 0), corners - 2 of them: a fan from corner 0 where it is convex,
// else by cutting ears off (Meisters 1975); a fan again for more than 256 corners, or where no ear is found.
std::vector<std::array<uint32_t, 3>> triangulated(std::span<const std::array<double, 3>> corners);

} // namespace semrover
