// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "engine/scene/scene_objects.h"

namespace semrover {

constexpr int32_t kNoObject = -1;
constexpr double kObjectReach = 1.5; // metres: balconies and mirrors stand out of boxes

// place of a point in the axes of an object's box, metres from the box's middle
std::array<double, 3> place_in(const SceneObject& object, const std::array<double, 3>& point);

// For each cell of a grid the index of the object that it belongs to, or kNoObject: among the objects of its class
// whose box, widened by kObjectReach on all sides, holds its centre, the one in which it lies deepest (of equals the
// first). The depth is the distance from the nearest face along the box's axes, negative outside.
std::vector<int32_t> objects_of_cells(const VoxelGrid& grid, std::span<const SceneObject> objects);

// Which objects somebody means who selects these cells (indices into `grid`): those of which more than half of the
// cells are among them or, where there is none, the one that has most of them. Indices, ascending; empty where the
// cells belong to no object.
std::vector<size_t> objects_meant(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                  std::span<const uint32_t> cells);

// Gives each object the median colour, channel by channel, of the points of its cells; objects without points keep what
// they have.
void tint_objects(std::span<SceneObject> objects, const VoxelGrid& grid);

} // namespace semrover
