// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover.h"

#include <array>
#include <cstdint>

namespace semrover::view {

using Vector = std::array<double, 3>; // metres in the world's frame: x forward, y left, z up

// Where the viewer looks from. It flies, or turns about a point ahead of it.
struct Camera {
    Vector position{0, 0, 1.7};
    double yaw = 0, pitch = 0; // radians: to the left of x, up
    double fov = 1.27;         // radians, across
    double distance = 8;       // metres to the point that it turns about

    Vector forward() const;
    Vector right() const;
    Vector pivot() const; // the point that it turns about

    void turn(double left, double up);                // radians, about itself
    void orbit(double left, double up);               // radians, about the pivot
    void zoom(double factor);                         // towards the pivot, which stays
    void move(double ahead, double right, double up); // metres

    std::array<double, 12> world_to_camera() const;                                        // OpenCV's axes, [3, 4]
    std::array<double, 4> lens(uint32_t width, uint32_t height) const;                     // fx, fy, cx, cy
    void aim(sr_draw_desc& draw) const;                                                    // needs width and height
    Vector place(double x, double y, double depth, uint32_t width, uint32_t height) const; // of a pixel with a depth

    bool operator==(const Camera&) const = default;
};

} // namespace semrover::view
