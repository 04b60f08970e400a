// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"
#include "engine/scene/palette.h"
#include "runtime/device/device.h"

#include <array>
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

// what is measured of points of one class, or of all: sums, so that grids can be pooled
struct ClassScores {
    uint64_t cells = 0, points = 0;             // on each side
    std::array<double, 3> generated{}, truth{}; // sums of the colours of all points, 0..1
    double cell_error = 0;                      // sum over voxels of the error of the voxel's mean colour
    double to_truth = 0, to_generated = 0;      // metres, sums of distances to the nearest point of the other side
    ContrastSums generated_contrast, truth_contrast;
    VarietySums generated_variety, truth_variety;

    ClassScores& operator+=(const ClassScores& other);
    double color_error() const;      // between the mean colours, mean of the three channels
    double cell_color_error() const; // likewise of each voxel, mean over the voxels
    double chamfer() const;          // metres, half the sum of both mean distances
};

struct PointScores {
    std::array<ClassScores, kClassCount> classes; // distances: to the nearest point of the class
    ClassScores all;                              // distances: to the nearest point of any class
    uint64_t left_out = 0;                        // voxels that are not generated on one side or the other

    PointScores& operator+=(const PointScores& other);
};

// Generated points against true ones. Errors: bad_input unless both have points, the same voxel size, points a cell and
// voxels, with the same labels, and at least one voxel that is generated on both sides; a radius beyond kMostReach
// voxels; out_of_memory, device_lost
Result<PointScores> score_points(Device& device, const VoxelGrid& generated, const VoxelGrid& truth,
                                 const ContrastOptions& options = {});

} // namespace semrover
