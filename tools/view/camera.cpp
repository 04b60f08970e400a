// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/camera.h"

#include <algorithm>
#include <cmath>

namespace semrover::view {

namespace {

constexpr double kSteepest = 1.55; // radians: straight down has no yaw

Vector added(const Vector& a, const Vector& b, double factor)
{
    return {a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]};
}

} // namespace

Vector Camera::forward() const
{
    return {std::cos(pitch) * std::cos(yaw), std::cos(pitch) * std::sin(yaw), std::sin(pitch)};
}

Vector Camera::right() const
{
    return {std::sin(yaw), -std::cos(yaw), 0};
}

Vector Camera::pivot() const
{
    return added(position, forward(), distance);
}

void Camera::turn(double left, double up)
{
    yaw += left;
    pitch = std::clamp(pitch + up, -kSteepest, kSteepest);
}

void Camera::orbit(double left, double up)
{
    const Vector about = pivot();
    turn(left, up);
    position = added(about, forward(), -distance);
}

void Camera::zoom(double factor)
{
    const Vector about = pivot();
    distance = std::clamp(distance * factor, 0.5, 500.0);
    position = added(about, forward(), -distance);
}

void Camera::move(double ahead, double to_right, double up)
{
    position = added(added(position, forward(), ahead), right(), to_right);
    position[2] += up;
}

std::array<double, 12> Camera::world_to_camera() const
{
    const Vector f = forward(), r = right();
    const Vector down = {f[1] * r[2] - f[2] * r[1], f[2] * r[0] - f[0] * r[2], f[0] * r[1] - f[1] * r[0]};
    std::array<double, 12> m{};
    const std::array<Vector, 3> rows = {r, down, f};
    for (size_t row = 0; row < 3; ++row)
        for (size_t c = 0; c < 3; ++c) {
            m[4 * row + c] = rows[row][c];
            m[4 * row + 3] -= rows[row][c] * position[c];
        }
    return m;
}

std::array<double, 4> Camera::lens(uint32_t width, uint32_t height) const
{
    const double focal = width / 2.0 / std::tan(fov / 2);
    return {focal, focal, width / 2.0, height / 2.0};
}

void Camera::aim(sr_draw_desc& draw) const
{
    const std::array<double, 4> pixels = lens(draw.width, draw.height);
    draw.fx = pixels[0];
    draw.fy = pixels[1];
    draw.cx = pixels[2];
    draw.cy = pixels[3];
    std::ranges::copy(world_to_camera(), draw.world_to_camera);
}

Vector Camera::place(double x, double y, double depth, uint32_t width, uint32_t height) const
{
    const std::array<double, 4> pixels = lens(width, height);
    const std::array<double, 12> m = world_to_camera();
    const Vector seen = {(x - pixels[2]) / pixels[0] * depth, (y - pixels[3]) / pixels[1] * depth, depth};
    Vector place = position;
    for (size_t row = 0; row < 3; ++row)
        for (size_t c = 0; c < 3; ++c)
            place[c] += m[4 * row + c] * seen[row];
    return place;
}

} // namespace semrover::view
