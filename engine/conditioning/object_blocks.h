// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/guessed_objects.h"
#include "engine/scene/tiles.h"

namespace semrover {

// Objects guessed so that those at a place depend on the labels near it, for worlds that are generated place by place
// (docs/method.md §2.2). The plane is cut into square blocks of 38.4 m. Each guesses from its labels and those up to
// half a block around it, and keeps the objects whose middle lies in it.

int32_t object_block_cells(float voxel_size); // the edge of a block

// the labels that a block's objects are guessed from
CellWindow labels_of_block(const TileIndex& block, int32_t block_cells);

// The blocks whose objects can reach a voxel of the window, in order. Objects that are too long for that are not kept.
std::vector<TileIndex> blocks_that_reach(const CellWindow& window, int32_t block_cells);

// The objects of one block. labels: what labels_of_block holds; more does not matter. ids begin at 0.
// Errors: as guess_objects
Result<std::vector<SceneObject>> guess_block(const VoxelGrid& labels, const TileIndex& block, const UsualObjects& usual,
                                             uint64_t seed);

// The objects of all blocks of a grid, block by block. ids begin at 0. Errors: as guess_objects
Result<std::vector<SceneObject>> guess_blocks(const VoxelGrid& grid, const UsualObjects& usual, uint64_t seed);

} // namespace semrover
