// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

namespace semrover {

// The voxels of a grid in groups of one label that are connected through faces, edges and corners: indices, ascending;
// groups in the order of their first voxels. Work: voxels x log(voxels).
std::vector<std::vector<uint32_t>> connected_groups(const VoxelGrid& grid);

} // namespace semrover
