// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/empty_frames.h"

#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr uint32_t kVisibleShift = 24;

} // namespace

bool sees_nothing(const FramePixels& frame)
{
    return std::ranges::none_of(frame.depths, [](uint32_t word) { return word; }) &&
           std::ranges::none_of(frame.seen, [](uint32_t word) { return word >> kVisibleShift; });
}

std::string extent_text(const Bounds& b)
{
    const auto metres = [](double v) { return fmt::format("{:.10g}", std::round(v * 10) / 10 + 0.0); };
    std::string text;
    for (size_t axis = 0; axis < 3; ++axis)
        text += fmt::format("{}{} {} to {}", axis ? ", " : "", "xyz"[axis], metres(b.low[axis]), metres(b.high[axis]));
    return text + " m";
}

Bounds bounds_of(const CameraPath& path)
{
    Bounds b{translation_of(path.frames.front().pose.camera_to_world()), {}};
    b.high = b.low;
    for (const CameraFrame& frame : path.frames) {
        const Point3 place = translation_of(frame.pose.camera_to_world());
        for (size_t axis = 0; axis < 3; ++axis) {
            b.low[axis] = std::min(b.low[axis], place[axis]);
            b.high[axis] = std::max(b.high[axis], place[axis]);
        }
    }
    return b;
}

Status EmptyFrames::report(const JobCallbacks& callbacks) const
{
    if (empty_ == 0)
        return {};
    if (callbacks.warning)
        callbacks.warning(fmt::format(
            "{} of {} frames see nothing of {}: it lies in {}, the cameras in {}; `relative_to`, `lidar_to_camera`, "
            "`world` and `origin` bring a trajectory into the grid's world (docs/scenes.md §3.1)",
            empty_, frames_, quote_path(scene_name_), extent_text(scene_), extent_text(path_)));
    if (all() && !allowed_)
        return fail(ErrorCode::bad_input,
                    "no frame of {} sees anything of {}, in {}: the cameras are in {}; `allow_empty` draws such frames "
                    "without an error",
                    frames_, quote_path(scene_name_), extent_text(scene_), extent_text(path_));
    return {};
}

} // namespace semrover
