// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"
#include "engine/scene/tile_cache.h"
#include "engine/voxfield/sub_grid.h"

namespace semrover {

// A window's result on its way to the tiles: windows/<window>.safetensors in the run folder, there until the tiles are
// written.
Path piece_path(const RunFolder& run, size_t window);
Status save_piece(const RunFolder& run, size_t window, const GrownCells& grown);
Result<GrownCells> load_piece(const Path& path, int points_per_voxel);

// of a filled part of the world: the cells that were its targets (indices of the whole, ascending)
GrownCells grown_cells(const SubGrid& part, std::span<const uint32_t> targets);

} // namespace semrover
