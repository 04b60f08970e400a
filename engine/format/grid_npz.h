// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

namespace semrover {

// The .npz mirror of a .sgrid, for numpy: cells i4 [V, 3], labels u1 [V], and for a grid with points points f2
// [V, n, 3], colors u1 [V, n, 3], generated u1 [V]; voxel_size f4 [], points_per_voxel i4 [], and metadata u1
// [bytes], a JSON object of texts.
// Read back it is the same grid. Integers of any type are taken; points may be f2, f4 or f8.
// Without voxel_size, `voxel_size` is taken. bad_input as for read_grid.
Result<VoxelGrid> read_grid_npz(const Path& path, float voxel_size);

// the same grid gives the same bytes; atomic; refuses what check_grid refuses
Status write_grid_npz(const Path& path, const VoxelGrid& grid);

} // namespace semrover
