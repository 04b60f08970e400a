// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <string>

namespace semrover {

// the points of a grid as a page draws them. Where no voxel has points, the cells' centres stand for them, in the
// colours of their labels.
struct PagePoints {
    uint64_t count = 0, total = 0;     // points kept, points of the grid
    std::array<double, 3> low{}, step; // metres: a coordinate q is low + q * step, q of 0..65535
    double diameter = 0;               // metres, of a point, so that neighbours touch
    bool centers = false;              // not points but voxels
    std::vector<std::byte> bytes;      // [count, 3] u16 little endian, [count, 3] u8 sRGB, [count] u8 label
};

// at most `limit` points (at least 1), every n-th in the order of the grid; the same grid gives the same bytes
PagePoints page_points(const VoxelGrid& grid, uint64_t limit);

} // namespace semrover
