// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/camera.h"

#include "engine/scene/image.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

Intrinsics scaled_to(const Intrinsics& intrinsics, uint32_t width, uint32_t height)
{
    SR_ASSERT(intrinsics.width > 0 && intrinsics.height > 0, "intrinsics without a size");
    const double sx = double(width) / intrinsics.width, sy = double(height) / intrinsics.height;
    // edges are at 0 and width, so the centre scales like a length
    return {intrinsics.fx * sx, intrinsics.fy * sy, intrinsics.cx * sx, intrinsics.cy * sy, width, height};
}

Intrinsics pinhole_from_fov(double horizontal_degrees, uint32_t width, uint32_t height)
{
    SR_ASSERT(horizontal_degrees > 0 && horizontal_degrees < 180, "field of view of {} degrees", horizontal_degrees);
    const double focal = width / 2.0 / std::tan(horizontal_degrees / 2 * std::numbers::pi / 180);
    return {focal, focal, width / 2.0, height / 2.0, width, height};
}

Status check_intrinsics(const Intrinsics& intrinsics, std::string_view where)
{
    const auto& [fx, fy, cx, cy, width, height] = intrinsics;
    if (width == 0 || height == 0 || width > kMaxImageSide || height > kMaxImageSide)
        return fail(ErrorCode::bad_input, "{}: an image of {} x {} pixels, expected 1 to {} each way", where, width,
                    height, kMaxImageSide);
    if (!std::isfinite(fx) || !std::isfinite(fy) || fx <= 0 || fy <= 0)
        return fail(ErrorCode::bad_input, "{}: expected focal lengths above 0, found {} and {}", where, fx, fy);
    if (!std::isfinite(cx) || !std::isfinite(cy))
        return fail(ErrorCode::bad_input, "{}: the principal point ({}, {}) is not finite", where, cx, cy);
    return {};
}

std::optional<Projection> project(const CameraFrame& frame, const Point3& world)
{
    const auto [x, y, z] = transform(frame.pose.world_to_camera, world);
    if (z <= 0)
        return std::nullopt;
    const Intrinsics& k = frame.intrinsics;
    return Projection{k.fx * x / z + k.cx, k.fy * y / z + k.cy, z};
}

bool is_camera_name(std::string_view name)
{
    const auto allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
               c == '-';
    };
    return !name.empty() && name.size() <= 64 && name[0] != '.' && std::ranges::all_of(name, allowed);
}

} // namespace semrover
