// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/conditioning/usual_objects.h"
#include "engine/scene/grid.h"

namespace semrover {

// The voxels of a grid in groups of one label that are connected through faces, edges and corners: indices, ascending;
// groups in the order of their first voxels. Work: voxels x log(voxels).
std::vector<std::vector<uint32_t>> connected_groups(const VoxelGrid& grid);

// Objects of a scene of which only labels are known (docs/method.md §2.2): boxes around connected voxels of a class,
// rows of them cut at usual lengths, buildings at the houses that their street shows. Each colour is drawn from the
// usual ones, keyed by the seed, the class and the object's lowest voxel. Ground has one colour a class, keyed by the
// seed and the class; its boxes are the blocks of object_blocks.h. Houses have the parts that are usual
// (street_fronts.h), which come last. Classes of which nothing is usual have no objects. The same labels and seed give
// the same objects. Errors: as objects_of_cells
Result<std::vector<SceneObject>> guess_objects(const VoxelGrid& grid, const UsualObjects& usual, uint64_t seed);

} // namespace semrover
