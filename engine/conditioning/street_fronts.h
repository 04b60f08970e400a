// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/conditioning/usual_objects.h"
#include "engine/scene/grid.h"

#include <set>

namespace semrover {

// a place seen from above: (i, j) of voxels
using Column = std::array<int32_t, 2>;

// columns that have a voxel of one of the labels
std::set<Column> columns_of(const VoxelGrid& grid, std::initializer_list<uint8_t> labels);

// of a row of houses what one house has of it
struct HouseFront {
    std::vector<uint32_t> cells; // ascending
    double heading = 0;          // towards the street, radians from x towards y
    double front = 0;            // metres along the heading, where most of its voxels lie
};

// Cuts connected building voxels into houses, as their street shows them. Walls face the street that is nearest to
// them, in one of four directions that are at right angles. A row is cut where its height steps by 1.2 m; what is
// longer than 1.6 `width` metres is cut again, at places that the seed decides. Sides of up to 1.2 `depth` belong to
// the house at the corner. Empty where no street is within 3.6 m.
std::vector<HouseFront> street_fronts(const VoxelGrid& grid, std::span<const uint32_t> cells,
                                      const std::set<Column>& street, double width, double depth, uint64_t seed);

constexpr double kPartsVary = 0.15;

// Parts of a house as its street may show them, windows: rows one above the other, columns across the front. Distances
// and sizes are the usual ones, longer or shorter by up to kPartsVary, the same for the whole house; each has a colour
// of the usual ones. All keyed by the seed and the house's lowest voxel. What stands out of the front above the ground
// floor is a balcony: rows and columns go through its floor and its middle, and the part behind it reaches down to it.
// Only where voxels of the front are. ids are 0.
std::vector<SceneObject> front_parts(const VoxelGrid& grid, const HouseFront& house, const UsualParts& usual,
                                     uint64_t seed);

} // namespace semrover
