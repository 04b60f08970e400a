// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

namespace semrover {

// A camera's mapping between rays in its frame (x right, y down, z forward) and pixels, and where it holds.
//   pinhole          a = x / z, b = y / z;  pixel = (fx a + cx, fy b + cy)
//   opencv           s = a^2 + b^2, R = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3);
//                    (a R + 2 p1 a b + p2 (s + 2 a^2) + s1 s + s2 s^2,
//                     b R + p1 (s + 2 b^2) + 2 p2 a b + s3 s + s4 s^2) in place of (a, b)
//   fisheye          t = angle from z, d = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8); (d x, d y) / hypot(x, y)
//   ftheta           d = f(t), or t = f(d), t = angle from z, f(v) = p1 v + .. + p5 v^5; (x, y) d / hypot(x, y) = (a,
//   b);
//                    pixel = (fx (c a + d b) + cx, fy (e a + b) + cy)
//   equirectangular  pixel = (fx atan2(x, z) + cx, fy asin(y / |p|) + cy)
// Source: OpenCV's calib3d and calib3d/fisheye; Kannala and Brandt 2006; FThetaCameraModelParameters of NVIDIA's NCore.
// The inverse of an f-theta lens's polynomial is exact, not another polynomial. The opencv mapping turns back on itself
// at some distance from the axis; the lens ends where it first does (fisheye: at the latest straight behind; ftheta: at
// the latest at max_angle). shaders/lib/lens.glsl does the same on the device.
class Lens {
  public:
    explicit Lens(const Intrinsics& intrinsics); // as check_intrinsics has them

    // of a point in the camera's frame; none behind a pinhole or opencv lens, and beyond the limit
    std::optional<Projection> project(const Point3& point) const;

    // unit ray through a position in the image; none where the lens does not look
    std::optional<Point3> ray(double x, double y) const;

    // opencv: largest distance from the axis at z = 1; fisheye, ftheta: largest angle from the axis, radians
    double limit() const { return limit_; }
    double reach() const { return reach_; } // ftheta: largest distance from the centre, pixels at fx = fy = 1

    // what a depth of this camera is: false: along z; true: from the camera. True for a panorama, and for a fisheye
    // (ftheta, too) that sees more than 90 degrees away from its axis somewhere in its image.
    bool radial_depth() const { return radial_depth_; }
    // of a point in the camera's frame, whether the lens sees it or not
    double depth(const Point3& point) const;

  private:
    std::optional<Point3> opencv_ray(double a, double b) const;
    std::optional<Point3> fisheye_ray(double a, double b) const;
    std::optional<Point3> ftheta_ray(double a, double b) const;
    void find_ftheta_ends();
    double ftheta_distance(double angle) const;
    double ftheta_angle(double distance) const;
    std::array<double, 2> from_image(double x, double y) const;
    bool sees_sideways() const;

    Intrinsics intrinsics_;
    double limit_ = 0, reach_ = 0;
    bool radial_depth_ = false;
};

} // namespace semrover
