// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply.h"
#include "engine/scene/grid.h"

namespace semrover {

// A semantic grid drawn as blocks: 5 x 5 surfels on every face of a cell that borders an empty cell, in label colours,
// large enough to leave no hole.
Surfels block_surfels(const VoxelGrid& grid);

} // namespace semrover
