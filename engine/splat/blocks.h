// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply.h"
#include "engine/scene/grid.h"

namespace semrover {

// A semantic grid drawn as blocks: 5 x 5 splats on every face of a voxel that borders an empty voxel, in label colours,
// large enough to leave no hole.
struct Blocks {
    Splats splats;
    std::vector<uint32_t> cells; // index of the voxel of each
};
Blocks block_splats(const VoxelGrid& grid);

} // namespace semrover
