// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <span>

namespace semrover {

// The voxels to generate and the known voxels around them, cut out of a grid that may be much larger.
struct SubGrid {
    VoxelGrid grid;              // targets have generated = 0, the known voxels around them 1
    std::vector<uint32_t> cells; // where they are in the whole
};

// targets [n]: ascending indices of voxels. The known voxels are those with points that no target is, within a reach
// that doubles from 8 voxels until every target has `considered` voxels in it (cells_considered of its regions), or 64
// voxels, or everything: so the regions of the sub-grid are those of the whole. Voxels without points that are no
// targets stay outside. Errors: bad_input, as extract_regions
Result<SubGrid> cut_sub_grid(const VoxelGrid& whole, std::span<const uint32_t> targets, int considered);

// Copies the points and colours of the targets that have them back into the whole, and nothing else. If the whole has
// no points, its other voxels get zeros.
void put_back(VoxelGrid& whole, const SubGrid& part, std::span<const uint32_t> targets);

// Allocates the arrays for n points a voxel, if the grid has none: zeros, generated = 0.
void make_room_for_points(VoxelGrid& grid, int points_per_voxel);

} // namespace semrover
