// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_grid.h"

namespace semrover {

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
