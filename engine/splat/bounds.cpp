// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/splat/bounds.h"

#include <algorithm>

namespace semrover {

Bounds bounds_of(const VoxelGrid& grid)
{
    Bounds b{{1e30, 1e30, 1e30}, {-1e30, -1e30, -1e30}};
    for (const Cell& cell : grid.cells)
        for (size_t a = 0; a < 3; ++a) {
            b.low[a] = std::min(b.low[a], double(cell[a]) * grid.voxel_size);
            b.high[a] = std::max(b.high[a], double(cell[a] + 1) * grid.voxel_size);
        }
    return b;
}

Bounds bounds_of(const Splats& splats)
{
    SR_ASSERT(!splats.position.empty(), "no splats");
    Bounds b;
    for (size_t a = 0; a < 3; ++a) {
        b.low[a] = b.high[a] = splats.position[0][a];
        for (const auto& p : splats.position) {
            b.low[a] = std::min(b.low[a], double(p[a]));
            b.high[a] = std::max(b.high[a], double(p[a]));
        }
    }
    return b;
}

} // namespace semrover
