// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "engine/scene/palette.h"

#include <array>
#include <span>

namespace semrover {

// How much brightness changes among points that lie near one another, and how much of it is edges: sums, so that grids
// can be pooled. Brightness is luma of the sRGB colour, 0.299 R + 0.587 G + 0.114 B, 0..1 (ITU-R BT.601).
struct ContrastSums {
    uint64_t pairs = 0;  // of points of a class within the radius, each counted from both its ends
    uint64_t strong = 0; // of these, with brightnesses further apart than the strong step
    double squares = 0;  // of the differences
    // a neighbourhood: a point and those of its class within the radius
    uint64_t neighborhoods = 0; // with kFewestPoints points or more
    double steps = 0;           // sum of best_step()
    double shuffled_steps = 0;  // likewise, after the brightnesses of the neighbourhood changed places at random

    ContrastSums& operator+=(const ContrastSums& other);
    double contrast() const;  // root mean square of the differences
    double edges() const;     // share of the pairs that are strong
    double sharpness() const; // root of the mean of what the best step explains beyond what it explains by chance
};

struct ContrastOptions {
    double radius = 0.3; // metres, at most kMostReach voxels
    double strong_step = 0.25;
};
constexpr size_t kFewestPoints = 6;
constexpr double kMostReach = 3;

// The variance of `brightness` that one step explains, at best: points are ordered along the direction in which
// brightness grows (the covariance of position and brightness) and cut in two, at least two on each side and none that
// are equally far along on different sides; the variance of the two means, weighted by their points. 0 if there is no
// such cut.
double best_step(std::span<const std::array<double, 3>> positions, std::span<const double> brightness);

// by class, of the voxels with a `used` that is not 0 [voxels of the grid]; a grid with points. What lies in other
// voxels is nobody's neighbour. Does not depend on the order of a voxel's points, nor on where the grid lies.
std::array<ContrastSums, kClassCount> local_contrast(const VoxelGrid& grid, std::span<const uint8_t> used,
                                                     const ContrastOptions& options = {});

} // namespace semrover
