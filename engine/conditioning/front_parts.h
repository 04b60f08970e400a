// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/conditioning/street_fronts.h"
#include "engine/conditioning/usual_objects.h"

namespace semrover {

constexpr double kPartsVary = 0.15;

// Parts of a house as its street may show them, windows: rows one above the other, columns across the front. Distances
// and sizes are the usual ones, longer or shorter by up to kPartsVary, the same for the whole house; each has a colour
// of the usual ones. All keyed by the seed and the house's lowest voxel. What stands out of the front above the ground
// floor is a balcony: rows and columns go through its floor and its middle, and the part behind it reaches down to it.
// Only where voxels of the front are. ids are 0.
std::vector<SceneObject> front_parts(const VoxelGrid& grid, const HouseFront& house, const UsualParts& usual,
                                     uint64_t seed);

} // namespace semrover
