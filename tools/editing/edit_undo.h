// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

namespace semrover {

// What an edit changed, and what was there before: a safetensors file (metadata format "semrover.undo", version "1").
//   cells [C, 3] i32, labels [C] u8, points [C, n, 3] f16, colors [C, n, 3] u8, generated [C] u8: voxels of the grid
//   before that are gone or differ; points, colors and generated when that grid had points
//   added [A, 3] i32: voxels that were not there
//   original [B] u8: all bytes of the file before, when it was not as write_grid writes (another program's): only then
// metadata: before and after (hashes of the two files), voxel_size and points_per_voxel of the grid before, metadata
// (its own, as JSON).

// before_path: the file that `before` was read from; after_path: `after` as it was written
Status write_undo(const Path& path, const Path& before_path, const VoxelGrid& before, const Path& after_path,
                  const VoxelGrid& after);

// writes the file before the edit, byte for byte. bad_input when `edited` is not the file that the record was made for,
// or the record is damaged; nothing is written then.
Status undo_edit(const Path& record, const Path& edited, const Path& output);

} // namespace semrover
