// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/npz.h"
#include "engine/scene/scene_grid.h"

namespace semrover {

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

} // namespace semrover
