// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <map>
#include <optional>

namespace semrover {

// labels of voxels; none: the voxel is not there
using LabelEdits = std::map<Cell, std::optional<uint8_t>>;

// A grid with its labels edited, sorted. Voxels whose label changes, and new ones, have no points.
VoxelGrid with_edits(const VoxelGrid& grid, const LabelEdits& edits);

} // namespace semrover
