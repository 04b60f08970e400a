// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/bounds.h"

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

} // namespace semrover
