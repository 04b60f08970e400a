// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <span>

namespace semrover {

// A stamp is a grid whose lowest corner is (0, 0, 0): a car, a facade, a crossing, cut out to be set elsewhere.

// the given voxels of a grid, with their points if the grid has any, moved to the origin; metadata "stamp_origin" says
// where they were. cells [n]: ascending indices, at least one.
VoxelGrid cut_stamp(const VoxelGrid& grid, std::span<const uint32_t> cells);

// turned counterclockwise seen from above, (x, y) -> (-y, x) each quarter, and moved to the origin again. Offsets of
// points turn with their voxels, exactly: four quarters give the same bytes.
VoxelGrid turned(const VoxelGrid& stamp, int quarter_turns);

// the lowest index along each axis
Cell lowest_corner(std::span<const Cell> cells);

} // namespace semrover
