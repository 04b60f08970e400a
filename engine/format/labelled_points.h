// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply.h"
#include "engine/scene/scene_grid.h"

namespace semrover {

// A point cloud as PLY: vertices with x y z, a label (an integer property label, class, semantic, semantic_label,
// class_id, classification, category or objtag), and perhaps red green blue (0..255, or 0..1 as floats). A voxel is
// where a point is; its label is that of most of its points, ties to the lower.
// With colours (unless `options.labels_only`) the result is a Sigma-Voxfield grid of options.points_per_voxel = n:
// where a voxel has more points, n are drawn by random numbers keyed by (seed, voxel, place in the file), those of the
// voxel's label first; where it has fewer, they are repeated in turn. Points keep the file's order. Points that are not
// finite are dropped with a warning. bad_input for files without these properties, and unknown labels (listed with
// counts).
Result<SceneGrid> read_labelled_points(const Path& path, const SceneGridOptions& options);

// The same for what CARLA's semantic lidar writes (save_to_disk: x y z CosAngle ObjIdx ObjTag). Its axes are x forward,
// y right, z up, and so left-handed: y is turned over before options.origin is added, and a warning says so. Tags need
// assets/label_maps/carla.json: since 0.9.14 they are Cityscapes' train ids + 1, and 24 for lane markings.
// Source: https://carla.readthedocs.io/en/latest/ref_sensors/#semantic-lidar-sensor and its example open3d_lidar.py
Result<SceneGrid> read_carla_points(const Path& path, const SceneGridOptions& options);

// the grid's points with colours and labels, those on a voxel's faces moved inside by 1e-4 of its size, so that reading
// finds the same voxels; of a grid without points, or voxels that have none, their centres in the
// colours of their labels
Splats labelled_points(const VoxelGrid& grid); // without normals, sizes and opacities
Status write_labelled_points(const Path& path, const VoxelGrid& grid);

} // namespace semrover
