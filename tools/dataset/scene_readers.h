// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_grid.h"
#include "tools/dataset/npz.h"

namespace semrover {

// The .npz mirror of a .sgrid, for numpy: cells i4 [V, 3], labels u1 [V], and for a grid with points points f2
// [V, n, 3], colors u1 [V, n, 3], generated u1 [V]; voxel_size f4 [], points_per_voxel i4 [], and metadata u1
// [bytes], a JSON object of texts.
// Read back it is the same grid. Whole numbers of any type are taken; points may be f2, f4 or f8. options.map says what
// labels are; without it they are our own, with a warning unless there is `metadata`, which we write. Sizes:
// voxel_sizes(); larger cells are made by coarsen(), and refused for a grid with points. options.origin is a whole
// number of the file's cells. bad_input as for read_grid.
Result<SceneGrid> read_grid_npz(const Path& path, const SceneGridOptions& options);

// the same grid gives the same bytes; atomic; refuses what check_grid refuses
Status write_grid_npz(const Path& path, const VoxelGrid& grid);

// Labels in an array of NumPy, as networks and data sets of occupancy have them: a .npy, or a .npz with one such array.
//   [X, Y, Z]  a label a voxel, any integer type, booleans or whole floats; leading sizes of 1 are left away
//   [N, 4]     x, y, z (voxels, from 0) and a label: SurroundOcc's and others'
// Nothing says what the numbers are: options.map does, else they are refused with counts and the tables that know them.
// Sizes: voxel_sizes(); a .npz may have an array voxel_size, of one number. options.origin is the corner of voxel (0,
// 0, 0). Cells: resample(). bad_input for other shapes, for more than 2^28 voxels, and lists whose box has more than
// 2^25.
Result<SceneGrid> read_label_array(const Path& path, const SceneGridOptions& options);

// the name of the only array of such a shape; empty if there are others, or none
std::string only_label_array(const NpzFile& file);

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

// SemanticKITTI's voxels: a box of 256 x 256 x 32 voxels of 0.2 m in the lidar's frame (x forward, y left, z up), 0 to
// 51.2, -25.6 to 25.6 and -2 to 4.4 m; voxel (x, y, z) is entry (x * 256 + y) * 32 + z. NNNNNN.label has a raw label
// (uint16, little endian, semantic-kitti.yaml's numbers) an entry, 0 where nothing is; NNNNNN.bin and NNNNNN.invalid a
// bit an entry, the most significant bit first: what one scan hit, and what no scan could see.
// The grid's world frame is the lidar's, so a 0.6 m cell is exactly 3 x 3 x 3 voxels (resample() in dense_labels.h).
// Source: https://github.com/PRBonn/semantic-kitti-api, config/semantic-kitti.yaml and README.md

// `path` is a .label, or a .bin with its .label beside it: then only voxels that the .bin has count. Voxels of an
// .invalid beside it never count. bad_input for a file of another size, and unknown labels (listed with counts).
Result<SceneGrid> read_semantic_kitti(const Path& path, const SceneGridOptions& options);

// NNNNNN.label and NNNNNN.bin, whichever of the two `path` names. Cells are split; what sticks out of the box is cut
// off. bad_input when whole cells are outside, or a cell is not a whole number of voxels. Classes that SemanticKITTI
// has not: traffic lights become traffic signs, sky is left out; `warnings` says how many.
Status write_semantic_kitti(const Path& path, const VoxelGrid& grid, std::vector<std::string>& warnings);

// MagicaVoxel as an editor of semantic grids: a voxel is a cell, or, with `options.file_voxel_size`, a part of one (as
// in dense_labels.h, `min_fill` too); z is up, colours are labels.
// A colour that is a class's in the palette is that class; another is taken by `options.map` (by its index, or by name,
// "#rrggbb"), or by the nearest class's with `nearest_color`, or else refused, all listed with counts. The scene's
// transforms place the models (rotations too); hidden nodes and layers are left out; where models overlap, the later
// counts. A file without a scene is one model from cell (0, 0, 0). `options.origin` must be whole voxels.
// bad_input also for more than 2^25 voxels, or 2^22 of models that are placed again.
Result<SceneGrid> read_vox(const Path& path, const SceneGridOptions& options);

// colour index = label + 1; one model for each 256 x 256 x 256 block that has cells, in place by its transform, so that
// reading gives the same cells. Points are not written; MagicaVoxel shows the 2000 cells around the origin.
Status write_vox(const Path& path, const VoxelGrid& grid);

} // namespace semrover
