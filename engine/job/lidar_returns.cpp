// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/lidar_returns.h"

#include "engine/scene/palette.h"

#include <cmath>

namespace semrover {

namespace {

// by label: engine/scene/palette.h
constexpr std::array<float, kClassCount> kReflectances = {
    0.15f, // road
    0.25f, // sidewalk
    0.4f,  // building
    0.4f,  // wall
    0.3f,  // fence
    0.4f,  // pole
    0.3f,  // traffic light
    0.9f,  // traffic sign
    0.5f,  // vegetation
    0.35f, // terrain
    0,     // sky
    0.4f,  // person
    0.4f,  // rider
    0.5f,  // car
    0.5f,  // truck
    0.5f,  // bus
    0.5f,  // train
    0.4f,  // motorcycle
    0.4f,  // bicycle
    0.6f,  // road-lane
};
constexpr float kUnknown = 0.3f;

// cosine between a ray and the surface that it meets
double facing(const Point3& ray, const float* normal)
{
    const double length = std::hypot(double(normal[0]), double(normal[1]), double(normal[2]));
    const double along = ray[0] * normal[0] + ray[1] * normal[1] + ray[2] * normal[2];
    return length > 0 ? std::min(std::abs(along) / length, 1.0) : 0;
}

} // namespace

float lidar_reflectance(uint32_t label)
{
    return label < kClassCount ? kReflectances[label] : kUnknown;
}

std::vector<LidarPoint> lidar_returns(const LidarSweep& sweep, const SweepImage& image, float least_alpha)
{
    const Lidar& lidar = *sweep.lidar;
    const SweepPicture picture(lidar);
    const bool moves = sweep.begin != sweep.end;
    const Rigid to_end = inverse(sweep.end);
    std::vector<LidarPoint> points;
    for (uint32_t column = 0; column < lidar.columns; ++column)
        for (uint32_t beam = 0; beam < lidar.beams.size(); ++beam) {
            const size_t at = beam * picture.width + size_t(int(column) + picture.shifts[beam] - picture.first);
            const double range = image.range[at];
            if (column % lidar.beams[beam].every || !(image.alpha[at] >= least_alpha) || !(range >= lidar.nearest) ||
                range > lidar.farthest)
                continue;
            const Point3 ray = lidar.ray(beam, column);
            const double intensity = lidar_reflectance(image.label[at]) * facing(ray, &image.normal[at * 3]);
            if (range > lidar.farthest_at_tenth * std::sqrt(intensity / 0.1))
                continue;
            const Point3 met = {range * ray[0], range * ray[1], range * ray[2]};
            const Point3 at_end = moves ? transform(compose(to_end, sweep.at(beam, column)), met) : met;
            points.push_back({float(at_end[0]), float(at_end[1]), float(at_end[2]), float(intensity),
                              uint16_t(lidar.ring(beam)), uint16_t(image.label[at]),
                              uint32_t(std::llround(lidar.firing_microseconds(beam, column))), image.instance[at]});
        }
    return points;
}

} // namespace semrover
