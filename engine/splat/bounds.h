// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/ply.h"
#include "engine/scene/grid.h"

namespace semrover {

struct Bounds {
    std::array<double, 3> low, high; // metres
};

// the box around all voxels of a grid
Bounds bounds_of(const VoxelGrid& grid);

// the box around the centres of splats, at least one
Bounds bounds_of(const Splats& splats);

} // namespace semrover
