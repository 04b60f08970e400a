// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "engine/scene/palette.h"

#include <span>

namespace semrover {

constexpr double kVarietyBlock = 6;       // metres, edge of a cube: about a house, a car
constexpr size_t kFewestVarietyCells = 5; // of a class in a cube that counts

// How much the colours of one class vary, within voxels and from one thing to the next: sums, so that grids can be
// pooled. Colours are sRGB, 0..1.
struct VarietySums {
    uint64_t cells = 0, blocks = 0;
    double within = 0;                      // sum over voxels of the points' deviation from the voxel's mean
    std::array<double, 3> sum{}, squares{}; // of the blocks' mean colours

    VarietySums& operator+=(const VarietySums& other);
    double detail() const; // mean deviation within a voxel
    double spread() const; // standard deviation of the blocks' mean colours; root mean square over the channels
};

// of the voxels that are used, by class. used: [V]
std::array<VarietySums, kClassCount> color_variety(const VoxelGrid& grid, std::span<const uint8_t> used);

} // namespace semrover
