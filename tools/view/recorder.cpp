// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/camera.h"

#include "runtime/base/json.h"
#include "runtime/base/quote.h"

#include <cmath>

namespace semrover::view {

namespace {

// camera to world: columns are the camera's axes right, down, forward, and its place
std::array<double, 12> camera_to_world(const Camera& camera)
{
    const std::array<double, 12> m = camera.world_to_camera();
    std::array<double, 12> inverse{};
    for (size_t row = 0; row < 3; ++row) {
        for (size_t c = 0; c < 3; ++c)
            inverse[4 * row + c] = m[4 * c + row];
        inverse[4 * row + 3] = camera.position[row];
    }
    return inverse;
}

// x, y, z, w. The camera's axes are those of one that looks along x, turned up and then to the left.
std::array<double, 4> quaternion_of(const Camera& camera)
{
    const double a = std::cos(camera.yaw / 2), b = std::sin(camera.yaw / 2);
    const double c = std::cos(camera.pitch / 2), d = -std::sin(camera.pitch / 2);
    const std::array<double, 4> turned = {-b * d, a * d, b * c, a * c};
    const std::array<double, 4> along_x = {-0.5, 0.5, -0.5, 0.5};
    const auto& [x, y, z, w] = turned;
    const auto& [p, q, r, s] = along_x;
    return {w * p + x * s + y * r - z * q, w * q - x * r + y * s + z * p, w * r + x * q - y * p + z * s,
            w * s - x * p - y * q - z * r};
}

} // namespace

void Recorder::add(const Camera& camera, double seconds)
{
    if (on && (poses_.empty() || poses_.back().camera != camera))
        poses_.push_back({seconds, camera});
}

std::string Recorder::tum() const
{
    std::string text = "# timestamp tx ty tz qx qy qz qw   camera to world; camera axes x right, y down, z forward\n";
    for (const Pose& pose : poses_)
        fmt::format_to(std::back_inserter(text), "{:.6f} {} {}\n", pose.seconds, fmt::join(pose.camera.position, " "),
                       fmt::join(quaternion_of(pose.camera), " "));
    return text;
}

std::string Recorder::transforms(uint32_t width, uint32_t height) const
{
    nlohmann::ordered_json file = {{"camera_model", "OPENCV"}, {"w", width}, {"h", height}};
    for (size_t n = 0; n < poses_.size(); ++n) {
        const std::array<double, 12> m = camera_to_world(poses_[n].camera);
        nlohmann::ordered_json frame = {{"file_path", fmt::format("color/{:06}.png", n)}, {"time", poses_[n].seconds}};
        const std::array<double, 4> lens = poses_[n].camera.lens(width, height);
        frame.update({{"fl_x", lens[0]}, {"fl_y", lens[1]}, {"cx", lens[2]}, {"cy", lens[3]}});
        for (size_t row = 0; row < 3; ++row) // OpenGL's axes: y up, z back
            frame["transform_matrix"].push_back({m[4 * row], -m[4 * row + 1], -m[4 * row + 2], m[4 * row + 3]});
        frame["transform_matrix"].push_back({0, 0, 0, 1});
        file["frames"].push_back(std::move(frame));
    }
    return json_text(file, 1) + "\n";
}

Status Recorder::save(const Path& path, uint32_t width, uint32_t height) const
{
    const std::string kind = path.extension().string();
    if (kind != ".json" && kind != ".tum" && kind != ".txt")
        return fail(ErrorCode::usage, "{}: a path is a .tum, a .txt (TUM) or a .json (nerfstudio)", quote_path(path));
    if (poses_.empty())
        return fail(ErrorCode::usage, "{}: no camera has been recorded", quote_path(path));
    return write_file_atomically(path, kind == ".json" ? transforms(width, height) : tum());
}

} // namespace semrover::view
