// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover.h"
#include "runtime/base/file.h"

#include <array>
#include <cstdint>
#include <vector>

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

// The way of the camera, to be saved as a path that `semrover render --path` reads.
class Recorder {
  public:
    bool on = false;

    void add(const Camera& camera, double seconds); // while it is on, and only where the camera has moved
    void clear() { poses_.clear(); }
    size_t size() const { return poses_.size(); }
    const Camera& at(size_t n) const { return poses_[n].camera; }

    // By the name: .json is nerfstudio's transforms.json with the lens of a picture of this size, .tum and .txt are
    // TUM, which has no lens. usage: another name, nothing recorded.
    Status save(const Path& path, uint32_t width, uint32_t height) const;

  private:
    struct Pose {
        double seconds = 0;
        Camera camera;
    };
    std::string tum() const;
    std::string transforms(uint32_t width, uint32_t height) const;

    std::vector<Pose> poses_;
};

} // namespace semrover::view
