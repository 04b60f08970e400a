// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/lidar_points.h"
#include "engine/job/sweep_drawing.h"

namespace semrover {

// how much a class reflects of a lidar's light, 0..1: a guess a class, not a measurement
float lidar_reflectance(uint32_t label);

// The returns of a sweep, in the order in which they are fired, then by beam. Places are in the sensor's axes at the
// sweep's end, from where each was fired; times from its begin. A ray gives no return where alpha is below
// `least_alpha`, the range is not what the lidar measures, or the light that comes back is too little. That light is
// taken to be intensity / range^2, where
//   intensity = reflectance of the class * cosine between ray and surface
// and a return is lost beyond farthest_at_tenth * sqrt(intensity / 0.1).
std::vector<LidarPoint> lidar_returns(const LidarSweep& sweep, const SweepImage& image, float least_alpha);

} // namespace semrover
