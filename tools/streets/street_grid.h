// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/mesh/voxelizer.h"
#include "engine/scene/grid.h"
#include "runtime/device/device.h"
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

struct SeenOptions {
    double reach = 45;         // metres
    uint32_t rays = 1u << 16;  // from each pose, evenly over the sphere: 0.6 m apart at 45 m
    double pose_spacing = 0.9; // metres; poses of the path that are nearer to the last one taken are left out
};

// Indices of the voxels, ascending, that somebody who moves along the paths sees: those that hold the nearest surface
// on some ray. What a drive records is no more than that; the backs of houses are not in it. Errors: device_lost,
// out_of_memory
Result<std::vector<uint32_t>> seen_cells(Device& device, const Mesh& mesh, const VoxelGrid& grid,
                                         std::span<const CameraPath> paths, const SeenOptions& options = {});

} // namespace semrover
