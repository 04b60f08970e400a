// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <span>

namespace semrover {

// the edge of a voxel in metres as it is written in decimals: 0.6, not 0.60000002384
double decimal_voxel_size(float voxel_size);

// the voxel that holds a point in metres; a point on a face belongs to the voxel above it
Cell cell_at(const std::array<double, 3>& metres, float voxel_size);

// the largest squared distance in voxels of two centres that are at most `metres` apart: 3 m of 0.6 m voxels give 25
int64_t reach_squared(double metres, float voxel_size);

// indices of the `cells` (unique, sorted) whose centres lie within sqrt(reach2) voxels of one of the `sources`,
// ascending; sources that are voxels themselves are among them. Work: sources x reach x log(voxels) and what is found.
std::vector<uint32_t> cells_within(std::span<const Cell> cells, std::span<const Cell> sources, int64_t reach2);

} // namespace semrover
