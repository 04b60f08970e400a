// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"
#include "tools/eval/color_variety.h"
#include "tools/eval/local_contrast.h"

namespace semrover {

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
