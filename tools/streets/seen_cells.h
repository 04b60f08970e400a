// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/scene/grid.h"
#include "runtime/device/device.h"
#include "tools/streets/street.h"

namespace semrover {

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
