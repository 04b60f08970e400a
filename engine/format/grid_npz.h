// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_grid.h"

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

} // namespace semrover
