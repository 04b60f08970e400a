// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <span>

namespace semrover {

// The cells to generate and the known cells around them, cut out of a grid that may be much larger.
struct SubGrid {
    VoxelGrid grid;              // targets have generated = 0, the known cells around them 1
    std::vector<uint32_t> cells; // where they are in the whole
};

// targets [n]: ascending indices of cells. The known cells are those with points that no target is, within a reach that
// doubles from 8 cells until every target has `considered` cells in it (cells_considered of its regions), or 64 cells,
// or everything: so the regions of the sub-grid are those of the whole. Cells without points that are no targets stay
// outside. Errors: bad_input, as extract_regions
Result<SubGrid> cut_sub_grid(const VoxelGrid& whole, std::span<const uint32_t> targets, int considered);

// Copies the points and colours of the targets that have them back into the whole, and nothing else. If the whole has
// no points, its other cells get zeros.
void put_back(VoxelGrid& whole, const SubGrid& part, std::span<const uint32_t> targets);

// Allocates the arrays for n points a cell, if the grid has none: zeros, generated = 0.
void make_room_for_points(VoxelGrid& grid, int points_per_voxel);

} // namespace semrover
