// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/editing/grid_editor.h"

#include <algorithm>

namespace semrover {

namespace {

void move_to_origin(VoxelGrid& grid)
{
    const Cell low = lowest_corner(grid.cells);
    for (Cell& cell : grid.cells)
        for (size_t a = 0; a < 3; ++a)
            cell[a] -= low[a];
}

} // namespace

Cell lowest_corner(std::span<const Cell> cells)
{
    Cell low = cells.front();
    for (const Cell& cell : cells)
        for (size_t a = 0; a < 3; ++a)
            low[a] = std::min(low[a], cell[a]);
    return low;
}

VoxelGrid cut_stamp(const VoxelGrid& grid, std::span<const uint32_t> cells)
{
    SR_ASSERT(!cells.empty(), "a stamp of no voxels");
    VoxelGrid stamp;
    stamp.voxel_size = grid.voxel_size;
    stamp.points_per_voxel = grid.points_per_voxel;
    for (const uint32_t c : cells)
        append_cell(stamp, grid, c);
    const Cell low = lowest_corner(stamp.cells);
    stamp.metadata["stamp_origin"] = fmt::format("{},{},{}", low[0], low[1], low[2]);
    move_to_origin(stamp);
    return stamp;
}

VoxelGrid turned(const VoxelGrid& stamp, int quarter_turns)
{
    constexpr uint16_t kSign = 0x8000; // of a half
    VoxelGrid out = stamp;
    for (int quarter = 0; quarter < quarter_turns % 4; ++quarter) {
        for (Cell& cell : out.cells)
            cell = {-cell[1] - 1, cell[0], cell[2]};
        for (size_t p = 0; p + 2 < out.points.size(); p += 3) {
            const uint16_t x = out.points[p], y = out.points[p + 1];
            out.points[p] = uint16_t(y ^ kSign);
            out.points[p + 1] = x;
        }
    }
    move_to_origin(out);
    sort_cells(out);
    return out;
}

} // namespace semrover
