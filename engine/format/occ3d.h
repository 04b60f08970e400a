// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_grid.h"

namespace semrover {

// Occ3D's labels.npz, in the vehicle's frame (x forward, y left, z up):
//   nuScenes: `semantics` [200, 200, 16] of 0.4 m, x and y from -40 m, z from -1 m; classes 0 to 16, 17 is free
//   Waymo: `voxel_label` (or `semantics`) [200, 200, 16] likewise, or [1600, 1600, 64] of 0.1 x 0.1 x 0.2 m, x and y
//          from -80 m, z from -5 m; classes 0 to 14, 15 or 23 is free
// `options.mask` names an array of the same shape (mask_camera, mask_lidar, infov, ...): voxels where it is 0 are left
// empty. 0.4 m voxels do not fill 0.6 m cells evenly: labels vote with their volume (resample() in dense_labels.h).
// bad_input for other shapes, types and unknown labels (listed with counts).
// Source: https://github.com/Tsinghua-MARS-Lab/Occ3D, README.md; class names and Waymo's 23: CVT-Occ, README.md
enum class Occ3dKind { nuscenes, waymo };
bool is_occ3d_shape(const std::vector<uint64_t>& shape);
Result<SceneGrid> read_occ3d(const Path& path, Occ3dKind kind, const SceneGridOptions& options);

} // namespace semrover
