// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/scene/grid.h"

namespace semrover {

constexpr int32_t kNoObject = -1;
constexpr double kObjectReach = 1.5; // metres: balconies and mirrors stand out of boxes
constexpr double kPartReach = 0.6;   // metres: what lies beside a window sees its edge

// the most pairs of an object and a voxel near it that are compared: each of a million voxels with a thousand boxes
constexpr uint64_t kMaxObjectPairs = 1ull << 30;

// place of a point in the axes of an object's box, metres from the box's middle
std::array<double, 3> place_in(const SceneObject& object, const std::array<double, 3>& point);

// For each voxel of a grid the index of the object that it belongs to, or kNoObject: among the objects of its class
// whose box, widened by kObjectReach on all sides, holds its centre, the one in which it lies deepest (of equals the
// first). The depth is the distance from the nearest face along the box's axes, negative outside. Parts own no voxels.
// The grid's voxels are sorted. Compares each object with the voxels of its class below and above the rectangle that
// its box covers. Errors: bad_input with the number of the object at which the comparisons, and the slices of voxels
// that they need, come to more than `most`.
Result<std::vector<int32_t>> objects_of_cells(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                              uint64_t most = kMaxObjectPairs);

// The instance numbers of a grid's points, as points_of() has them, by the same rule at the place of the point in place
// of the voxel's centre; of a grid without points, of its voxels. Errors: as objects_of_cells
Result<std::vector<uint32_t>> instances_of_points(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                                  uint64_t most = kMaxObjectPairs);

// the same of the objects that are parts, whose boxes are widened by kPartReach
Result<std::vector<int32_t>> parts_of_cells(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                            uint64_t most = kMaxObjectPairs);

// Which of a number of objects somebody means who selects these voxels, by objects_of_cells: those of which more than
// half of the voxels are among them or, where there is none, the one that has most of them. Indices, ascending; empty
// where the voxels belong to no object.
std::vector<size_t> objects_meant(std::span<const int32_t> owners, size_t objects, std::span<const uint32_t> cells);

// Gives each object the colour of its paint: the median, channel by channel, of the lighter two fifths (by Rec. 709
// luma) of its cells' points. A car's windows and tyres are more than half of it. A part gets the median of the points
// that lie 2 cm or more within its box. Objects without points keep what they have. Errors: as objects_of_cells
Status tint_objects(std::span<SceneObject> objects, const VoxelGrid& grid);

} // namespace semrover
