// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/mesh/voxelizer.h"
#include "tools/streets/street.h"

#include <span>

namespace semrover {

struct StreetGrids {
    VoxelGrid truth, semantic; // the same voxels and labels, with points and without
};

// A street's voxels. A voxel that lane markings cover by more than `lane_share` of a face's area is road-lane, though
// road covers more of it: a line of 14 cm never wins against the 60 cm of a cell. Errors: those of voxelize()
Result<StreetGrids> street_grids(Device& device, const Street& street, const VoxelizeOptions& options,
                                 float lane_share = 0.08f);

// those of the `cells` (indices, ascending)
StreetGrids part_of(const StreetGrids& grids, std::span<const uint32_t> cells);

} // namespace semrover
