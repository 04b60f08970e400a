// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/camera.h"

#include "engine/camera/image_size.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace semrover {

namespace {

constexpr std::string_view kModelNames[] = {"pinhole", "opencv", "fisheye", "equirectangular", "ftheta"};
constexpr std::string_view kDirectionNames[] = {"down", "up", "right", "left"};
constexpr double kMostDistortion = 1e6; // beyond any lens, and squares are finite in fp32

Status check_ftheta(const Distortion& k, std::string_view where)
{
    if (!(k[0] > 0))
        return fail(ErrorCode::bad_input, "{}: a polynomial that does not rise at 0, its second coefficient is {}",
                    where, k[0]);
    if (!(k[5] - k[6] * k[7] > 1e-3))
        return fail(ErrorCode::bad_input, "{}: linear_cde {}, {}, {} turns pictures over or folds them", where, k[5],
                    k[6], k[7]);
    if (!(k[8] > 0))
        return fail(ErrorCode::bad_input, "{}: expected a max_angle above 0 radians, found {}", where, k[8]);
    return {};
}

Status check_model(const Intrinsics& k, std::string_view where)
{
    const size_t coefficients = k.model == CameraModel::opencv    ? 12
                                : k.model == CameraModel::fisheye ? 4
                                : k.model == CameraModel::ftheta  ? 10
                                                                  : 0;
    for (size_t i = 0; i < k.distortion.size(); ++i) {
        if (!std::isfinite(k.distortion[i]) || std::abs(k.distortion[i]) > kMostDistortion)
            return fail(ErrorCode::bad_input, "{}: expected distortion coefficients of at most {:g}, found {}", where,
                        kMostDistortion, k.distortion[i]);
        if (i >= coefficients && k.distortion[i] != 0)
            return fail(ErrorCode::bad_input, "{}: a camera of model {} has no distortion coefficient {}, found {}",
                        where, name_of(k.model), i + 1, k.distortion[i]);
    }
    if (k.model == CameraModel::ftheta)
        return check_ftheta(k.distortion, where);
    if (k.model != CameraModel::equirectangular)
        return {};
    const Intrinsics whole = whole_sphere(k.width, k.height);
    for (const auto& [found, expected] :
         {std::pair{k.fx, whole.fx}, {k.fy, whole.fy}, {k.cx, whole.cx}, {k.cy, whole.cy}})
        if (std::abs(found - expected) > 1e-6 * expected)
            return fail(ErrorCode::bad_input,
                        "{}: expected a panorama of the whole sphere ({:.6g} pixels, found {:.6g})", where, expected,
                        found);
    return {};
}

} // namespace

Intrinsics scaled_to(const Intrinsics& intrinsics, uint32_t width, uint32_t height)
{
    SR_ASSERT(intrinsics.width > 0 && intrinsics.height > 0, "intrinsics without a size");
    const double sx = double(width) / intrinsics.width, sy = double(height) / intrinsics.height;
    Intrinsics k = intrinsics; // edges are at 0 and width, so the centre scales like a length
    k.fx *= sx;
    k.fy *= sy;
    k.cx *= sx;
    k.cy *= sy;
    k.width = width;
    k.height = height;
    return k;
}

Intrinsics pinhole_from_fov(double horizontal_degrees, uint32_t width, uint32_t height)
{
    SR_ASSERT(horizontal_degrees > 0 && horizontal_degrees < 180, "field of view of {} degrees", horizontal_degrees);
    const double focal = width / 2.0 / std::tan(horizontal_degrees / 2 * std::numbers::pi / 180);
    return {focal, focal, width / 2.0, height / 2.0, width, height};
}

Intrinsics fisheye_from_fov(double horizontal_degrees, uint32_t width, uint32_t height)
{
    SR_ASSERT(horizontal_degrees > 0 && horizontal_degrees <= 360, "field of view of {} degrees", horizontal_degrees);
    const double focal = width / (horizontal_degrees * std::numbers::pi / 180);
    return {focal, focal, width / 2.0, height / 2.0, width, height, CameraModel::fisheye};
}

Intrinsics whole_sphere(uint32_t width, uint32_t height)
{
    return {width / (2 * std::numbers::pi), height / std::numbers::pi, width / 2.0, height / 2.0, width, height,
            CameraModel::equirectangular};
}

Intrinsics simplified(Intrinsics intrinsics)
{
    if (intrinsics.model == CameraModel::opencv && intrinsics.distortion == Distortion{})
        intrinsics.model = CameraModel::pinhole;
    return intrinsics;
}

Status check_intrinsics(const Intrinsics& intrinsics, std::string_view where)
{
    const Intrinsics& k = intrinsics;
    if (k.width == 0 || k.height == 0 || k.width > kMaxImageSide || k.height > kMaxImageSide)
        return fail(ErrorCode::bad_input, "{}: an image of {} x {} pixels, expected 1 to {} each way", where, k.width,
                    k.height, kMaxImageSide);
    if (!std::isfinite(k.fx) || !std::isfinite(k.fy) || k.fx <= 0 || k.fy <= 0)
        return fail(ErrorCode::bad_input, "{}: expected focal lengths above 0, found {} and {}", where, k.fx, k.fy);
    if (!std::isfinite(k.cx) || !std::isfinite(k.cy))
        return fail(ErrorCode::bad_input, "{}: the principal point ({}, {}) is not finite", where, k.cx, k.cy);
    return check_model(k, where);
}

std::string_view name_of(CameraModel model)
{
    return kModelNames[size_t(model)];
}

std::optional<CameraModel> camera_model_of(std::string_view name)
{
    const auto found = std::ranges::find(kModelNames, name);
    if (found == std::end(kModelNames))
        return std::nullopt;
    return CameraModel(found - std::begin(kModelNames));
}

std::string_view name_of(ShutterDirection direction)
{
    return kDirectionNames[size_t(direction)];
}

std::optional<ShutterDirection> shutter_direction_of(std::string_view name)
{
    const auto found = std::ranges::find(kDirectionNames, name);
    if (found == std::end(kDirectionNames))
        return std::nullopt;
    return ShutterDirection(found - std::begin(kDirectionNames));
}

Rigid LidarSweep::at(uint32_t beam, uint32_t column) const
{
    return interpolate(begin, end, lidar->firing_microseconds(beam, column) * 1e-6 * lidar->rate);
}

Rigid CameraPath::file_pose(size_t frame) const
{
    const Rigid camera = frames[frame].pose.camera_to_world();
    return body ? compose(camera, inverse(body->forward_camera_to_body)) : camera;
}

bool is_camera_name(std::string_view name)
{
    const auto allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
               c == '-';
    };
    return !name.empty() && name.size() <= 64 && name[0] != '.' && std::ranges::all_of(name, allowed);
}

int64_t microseconds_of(double seconds)
{
    return std::llround(seconds * 1e6);
}

} // namespace semrover
