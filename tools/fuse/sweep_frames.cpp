// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/fuse/sweep_frames.h"

#include "engine/format/lidar_points.h"
#include "engine/scene/palette.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace semrover {

namespace {

constexpr double kSamePicture = 0.1; // seconds: half a turn and half of the time between a slow camera's pictures

struct Slopes {
    double lowest = 0, highest = 0;
};

Result<Slopes> slopes_of(const std::vector<RecordedSweep>& sweeps)
{
    Slopes slopes;
    for (const RecordedSweep& sweep : sweeps) {
        SR_TRY(const std::vector<ScanPoint> points, read_scan(sweep.points));
        for (const ScanPoint& p : points)
            if (const double slope = p[2] / std::hypot(p[0], p[1]); std::abs(slope) < 1)
                slopes = {std::min(slopes.lowest, slope), std::max(slopes.highest, slope)};
    }
    return slopes;
}

// of each camera the frame nearest to a time, where it is near enough
std::vector<size_t> pictures_at(double time, const std::vector<CameraFrame>& cameras)
{
    std::map<std::string, size_t> nearest;
    const auto away = [&](size_t frame) { return std::abs(cameras[frame].time - time); };
    for (size_t i = 0; i < cameras.size(); ++i) {
        const auto [there, fresh] = nearest.try_emplace(cameras[i].camera, i);
        if (!fresh && away(i) < away(there->second))
            there->second = i;
    }
    std::vector<size_t> pictures;
    for (const auto& [camera, frame] : nearest)
        if (away(frame) <= kSamePicture)
            pictures.push_back(frame);
    return pictures;
}

} // namespace

Result<std::optional<Path>> find_lidar(const Path& folder)
{
    SR_TRY(const std::vector<Path> folders, list_folders(folder));
    const auto lidar = std::ranges::find_if(folders, [](const Path& f) { return is_file(f / kSweepsName); });
    return lidar == folders.end() ? std::optional<Path>() : *lidar;
}

Result<SweepFrames> SweepFrames::open(const Path& lidar, const Rigid& placed, const std::vector<CameraFrame>& cameras)
{
    SweepFrames f;
    SR_TRY(f.sweeps_, read_sweeps(lidar));
    SR_TRY(const Slopes slopes, slopes_of(f.sweeps_));
    f.views_ = sweep_views(slopes.lowest, slopes.highest);
    for (const RecordedSweep& sweep : f.sweeps_) {
        const Rigid from_world = inverse(compose(placed, sweep.to_world));
        for (const PinholeView& view : f.views_) {
            CameraFrame frame;
            frame.time = double(sweep.time) * 1e-6;
            frame.camera = lidar.filename().string();
            frame.pose.world_to_camera = compose(view.from_sensor, from_world);
            frame.intrinsics = view.intrinsics;
            f.frames_.push_back(std::move(frame));
        }
        f.pictures_of_.push_back(pictures_at(double(sweep.time) * 1e-6, cameras));
    }
    if (f.frames_.empty())
        return fail(ErrorCode::bad_input, "{}: no sweeps", quote_path(lidar / kSweepsName));
    return f;
}

Status SweepFrames::load_sweep(size_t sweep, const LoadPicture& picture)
{
    if (loaded_ == sweep)
        return {};
    SR_TRY(const std::vector<ScanPoint> points, read_scan(sweeps_[sweep].points));
    surface_.emplace(points);
    pictures_.clear();
    for (const size_t frame : pictures_of_[sweep]) {
        SR_TRY(DepthImages images, picture(frame));
        pictures_.push_back({frame, std::move(images)});
    }
    loaded_ = sweep;
    return {};
}

Result<DepthImages> SweepFrames::load(size_t frame, const std::vector<CameraFrame>& cameras, const LoadPicture& picture)
{
    SR_CHECK(load_sweep(frame / views_.size(), picture));
    DepthImages images = seen_by(views_[frame % views_.size()], *surface_);
    paint(frames_[frame], cameras, images);
    return images;
}

void SweepFrames::paint(const CameraFrame& view, const std::vector<CameraFrame>& cameras, DepthImages& images) const
{
    struct Eye {
        Lens lens;
        Rigid from_view;
        const Intrinsics& size;
        const DepthImages& images;
    };
    std::vector<Eye> eyes;
    const bool colored = std::ranges::any_of(pictures_, [](const Picture& p) { return !p.images.colors.empty(); });
    for (const Picture& p : pictures_) {
        const CameraFrame& camera = cameras[p.frame];
        eyes.push_back({Lens(camera.intrinsics), compose(camera.pose.world_to_camera, view.pose.camera_to_world()),
                        camera.intrinsics, p.images});
    }
    if (colored)
        images.colors.assign(3 * images.depth.size(), 0);
    const Intrinsics& k = view.intrinsics;
    for (size_t i = 0; i < images.depth.size(); ++i) {
        const double z = images.depth[i];
        if (!(z > 0))
            continue;
        const Point3 point = {(double(i % k.width) + 0.5 - k.cx) / k.fx * z,
                              (double(i / k.width) + 0.5 - k.cy) / k.fy * z, z};
        const Eye* best = nullptr;
        size_t pixel = 0;
        double most = -2;
        for (const Eye& eye : eyes) {
            const Point3 p = transform(eye.from_view, point);
            const auto at = eye.lens.project(p);
            const double straight = p[2] / std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
            if (!at || !(at->x >= 0 && at->y >= 0 && at->x < eye.size.width && at->y < eye.size.height) ||
                straight <= most)
                continue;
            best = &eye;
            most = straight;
            pixel = size_t(at->y) * eye.size.width + size_t(at->x);
        }
        if (!best) {
            images.depth[i] = colored ? 0 : images.depth[i];
            continue;
        }
        if (!best->images.colors.empty())
            std::copy_n(&best->images.colors[3 * pixel], 3, &images.colors[3 * i]);
        if (images.labels[i] == kNoLabel && !best->images.labels.empty())
            images.labels[i] = best->images.labels[pixel];
        if (!best->images.depth.empty() && best->images.depth[pixel] <= 0) // left out by the map of labels
            images.depth[i] = 0;
    }
}

} // namespace semrover
