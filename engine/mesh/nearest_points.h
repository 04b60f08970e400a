// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"

#include <array>
#include <span>
#include <vector>

namespace semrover {

using PointRow = std::array<float, 4>; // metres, near the origin where floats are exact enough; the last is unused

struct NearestPointsOptions {
    float cell_size = 0.3f;    // metres, of the search grid
    float first_radius = 0.9f; // metres that are searched first; only queries with no point there see all of them
};

// metres from each query to the nearest of the points (at least one of them), exact, in double.
// Errors: out_of_memory, device_lost
Result<std::vector<double>> nearest_distances(Device& device, std::span<const PointRow> queries,
                                              std::span<const PointRow> points,
                                              const NearestPointsOptions& options = {});

} // namespace semrover
