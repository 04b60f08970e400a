// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/lens.h"
#include "engine/fusion/depth_frames.h"
#include "engine/scene/palette.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

// A street of analytic shapes: road, kerb and sidewalk, buildings, a car, a bush, a pole. Rays are cast in double, and
// the distance to the surface is known everywhere.
class StreetScene {
  public:
    static double length(const Point3& p) { return std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]); }

    struct Shape {
        enum Kind { box, sphere, cylinder } kind;
        uint8_t label;
        Point3 at, half; // box: centre, half sizes; sphere: radius in half[0]; cylinder: radius half[0], z +- half[2]

        // signed, exact
        double distance(const Point3& p) const
        {
            const Point3 d = {p[0] - at[0], p[1] - at[1], p[2] - at[2]};
            if (kind == sphere)
                return length(d) - half[0];
            if (kind == cylinder)
                return rounded(std::hypot(d[0], d[1]) - half[0], std::abs(d[2]) - half[2]);
            const Point3 q = {std::abs(d[0]) - half[0], std::abs(d[1]) - half[1], std::abs(d[2]) - half[2]};
            const Point3 out = {std::max(q[0], 0.0), std::max(q[1], 0.0), std::max(q[2], 0.0)};
            return length(out) + std::min(std::max({q[0], q[1], q[2]}), 0.0);
        }

        // distance along a ray from outside, infinite for none
        double hit(const Point3& from, const Point3& ray) const
        {
            const Point3 d = {from[0] - at[0], from[1] - at[1], from[2] - at[2]};
            if (kind == sphere)
                return quadratic(dot(ray, ray), dot(d, ray), dot(d, d) - half[0] * half[0]).first;
            double enter = 0, leave = kNone;
            for (size_t axis = kind == cylinder ? 2 : 0; axis < 3; ++axis)
                slab(d[axis], ray[axis], half[axis], enter, leave);
            if (kind == cylinder) {
                const auto [a, b] = quadratic(ray[0] * ray[0] + ray[1] * ray[1], d[0] * ray[0] + d[1] * ray[1],
                                              d[0] * d[0] + d[1] * d[1] - half[0] * half[0]);
                enter = std::max(enter, a);
                leave = std::min(leave, b);
            }
            return enter > 0 && enter < leave ? enter : kNone;
        }
    };

    double distance(const Point3& p) const
    {
        double nearest = kNone;
        for (const Shape& s : shapes)
            nearest = std::min(nearest, s.distance(p));
        return nearest;
    }
    uint8_t label(const Point3& p) const
    {
        return std::ranges::min_element(shapes, {}, [&](const Shape& s) { return std::abs(s.distance(p)); })->label;
    }

    struct Seen {
        double metres = std::numeric_limits<double>::infinity(); // in lengths of the ray
        uint8_t label = 10;
    };
    Seen along(const Point3& from, const Point3& ray) const
    {
        Seen seen;
        for (const Shape& s : shapes)
            if (const double t = s.hit(from, ray); t < seen.metres)
                seen = {t, s.label};
        return seen;
    }

    // depth as the camera's lens has it
    DepthImages render(const CameraFrame& frame) const
    {
        const Intrinsics& k = frame.intrinsics;
        const Lens lens(k);
        const Rigid camera_to_world = frame.pose.camera_to_world();
        const Point3 from = translation_of(camera_to_world);
        DepthImages images;
        for (uint32_t y = 0; y < k.height; ++y)
            for (uint32_t x = 0; x < k.width; ++x) {
                const auto own = lens.ray(x + 0.5, y + 0.5);
                const Point3 ahead = transform(camera_to_world, own.value_or(Point3{}));
                const Point3 ray = {ahead[0] - from[0], ahead[1] - from[1], ahead[2] - from[2]};
                const Seen seen = own ? along(from, ray) : Seen();
                const double depth = own ? seen.metres * lens.depth(*own) : kNone;
                images.depth.push_back(depth < 65 ? float(std::lround(depth * 1000)) * 0.001f : 0.f);
                images.labels.push_back(seen.label);
                images.colors.insert(images.colors.end(), kPalette[seen.label].color.begin(),
                                     kPalette[seen.label].color.end());
            }
        return images;
    }

    // looks along x, turned to the left and down by angles in radians
    static CameraFrame camera(const Point3& at, double left, double down, const Intrinsics& k)
    {
        const double c = std::cos(left), s = std::sin(left), cd = std::cos(down), sd = std::sin(down);
        const Point3 forward = {c * cd, s * cd, -sd}, right = {s, -c, 0};
        const Point3 below = {forward[1] * right[2] - forward[2] * right[1],
                              forward[2] * right[0] - forward[0] * right[2],
                              forward[0] * right[1] - forward[1] * right[0]};
        CameraFrame frame;
        frame.intrinsics = k;
        Rigid m = {right[0], below[0], forward[0], at[0], right[1], below[1], forward[1], at[1],
                   right[2], below[2], forward[2], at[2], 0,        0,        0,          1};
        frame.pose.world_to_camera = inverse(m);
        return frame;
    }

    // a drive of `count` frames, slightly shaken
    static std::vector<CameraFrame> drive(size_t count, uint32_t width = 160, uint32_t height = 120)
    {
        std::vector<CameraFrame> frames;
        const Intrinsics k = pinhole_from_fov(80, width, height);
        for (size_t i = 0; i < count; ++i) {
            const double t = double(i);
            frames.push_back(camera({0.45 * t, 0.2 * std::sin(t), 1.6 + 0.05 * std::cos(2 * t)},
                                    0.15 * std::sin(1.7 * t), 0.12 + 0.03 * std::cos(t), k));
            frames.back().time = t;
        }
        return frames;
    }

    DepthFrames frames(std::vector<CameraFrame> cameras) const
    {
        std::vector<DepthImages> images;
        for (const CameraFrame& c : cameras)
            images.push_back(render(c));
        return {std::move(cameras), [images](size_t i) -> Result<DepthImages> { return images[i]; }};
    }

    std::vector<Shape> shapes = {
        {Shape::box, 0, {0, 0, -1}, {200, 200, 1}},
        {Shape::box, 1, {50, 6.5, 0}, {100, 3, 0.15}}, // kerb at y = 3.5
        {Shape::box, 2, {20, 11, 3}, {12, 4, 3.5}},
        {Shape::box, 2, {16, -9, 3}, {9, 3.5, 3.5}},
        {Shape::box, 13, {9, -2.4, 0.75}, {2.1, 0.9, 0.75}},
        {Shape::sphere, 8, {7, 5.2, 1}, {0.9, 0, 0}},
        {Shape::cylinder, 5, {5.5, 4.1, 2}, {0.15, 0, 2}},
    };

  private:
    static constexpr double kNone = std::numeric_limits<double>::infinity();
    static double dot(const Point3& a, const Point3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
    static double rounded(double x, double y)
    {
        return std::hypot(std::max(x, 0.0), std::max(y, 0.0)) + std::min(std::max(x, y), 0.0);
    }
    // roots of a t^2 + 2 b t + c, infinite for none
    static std::pair<double, double> quadratic(double a, double b, double c)
    {
        const double root = b * b - a * c;
        if (root < 0 || a == 0)
            return {kNone, kNone};
        return {(-b - std::sqrt(root)) / a, (-b + std::sqrt(root)) / a};
    }
    static void slab(double d, double ray, double half, double& enter, double& leave)
    {
        if (ray == 0) {
            if (std::abs(d) > half)
                enter = kNone;
            return;
        }
        const double a = (-half - d) / ray, b = (half - d) / ray;
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
    }
};

} // namespace semrover
