// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/path_renderer.h"

#include "engine/camera/rig.h"
#include "engine/splat/blocks.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

// end of the run of frames from `first` with the same time, size and camera model
size_t end_of_moment(const CameraPath& path, size_t first)
{
    const CameraFrame& a = path.frames[first];
    size_t end = first + 1;
    for (; end < path.frames.size(); ++end) {
        const CameraFrame& b = path.frames[end];
        if (b.time != a.time || b.camera == a.camera || b.intrinsics.width != a.intrinsics.width ||
            b.intrinsics.height != a.intrinsics.height || b.intrinsics.model != a.intrinsics.model)
            break;
    }
    return end;
}

} // namespace

Result<SurfelOptions> surfel_options(const std::string& splat_radius, float opacity)
{
    SurfelOptions s;
    s.opacity = opacity;
    s.auto_sigma = splat_radius == "auto";
    if (s.auto_sigma || splat_radius.empty())
        return s;
    char* end = nullptr;
    s.sigma = std::strtof(splat_radius.c_str(), &end);
    if (*end || !(s.sigma > 0 && s.sigma < 100))
        return fail(ErrorCode::usage, "--splat-radius takes metres (0..100) or auto, not '{}'", splat_radius);
    return s;
}

void add_drive_options(CLI::App& c, DriveOptions& o)
{
    c.add_option(
        "--path", o.path,
        "camera path: TUM, KITTI, nerfstudio transforms.json or camera_path.json, or a folder of COLMAP's text");
    add_lens_options(c, o);
    c.add_flag("--equirect", o.equirect, "panoramas of W x W/2 in place of the path's cameras");
    c.add_option("--rig", o.rig, "rig.json: every sensor at every pose, in folders of their names");
    c.add_option(
        "--splat-radius", o.splat_radius,
        "standard deviation of a splat in metres (0.04, or what the renderer says), or auto: from the spacing of "
        "the points");
    c.add_option("--opacity", o.opacity, "of every splat")->check(CLI::Range(0.01f, 1.f));
    c.add_option("--visible-alpha", o.visible_alpha, "alpha from which a pixel counts as visible")
        ->check(CLI::Range(0.f, 1.f));
    c.add_option("--background", o.background, "R,G,B behind the splats");
}

Status check_drive(const DriveOptions& o)
{
    SR_CHECK(surfel_options(o.splat_radius, o.opacity).map([](const auto&) {}));
    SR_CHECK(intrinsics_of(o).map([](const auto&) {}));
    if (o.equirect && !o.rig.empty())
        return fail(ErrorCode::usage, "--equirect or --rig; a rig.json may have an equirectangular sensor");
    if (o.equirect && o.width % 2)
        return fail(ErrorCode::usage, "--equirect draws W x W/2 pixels, and {} is odd", o.width);
    return background_of(o).map([](const auto&) {});
}

Result<std::array<uint8_t, 3>> background_of(const DriveOptions& o)
{
    unsigned r, g, b;
    int used = 0;
    if (std::sscanf(o.background.c_str(), "%u,%u,%u%n", &r, &g, &b, &used) != 3 ||
        size_t(used) != o.background.size() || r > 255 || g > 255 || b > 255)
        return fail(ErrorCode::usage, "--background takes R,G,B in 0..255, not '{}'", o.background);
    return std::array<uint8_t, 3>{uint8_t(r), uint8_t(g), uint8_t(b)};
}

// points as generated; a grid without points, or --semantic, in label colours
Result<SurfelScene> load_scene(const DriveOptions& o, const Path& grid_path, const VoxelGrid& grid, Device& device)
{
    SR_TRY(const SurfelOptions surfels, surfel_options(o.splat_radius, o.opacity));
    ScenePoints points = points_of(grid);
    if (points.size() == 0 && !o.semantic)
        return fail(ErrorCode::bad_input, "{} has no points yet: generate them, or draw its labels with --semantic",
                    quote_path(grid_path));
    if (points.size() == 0)
        return SurfelScene::create(device, block_surfels(grid));
    if (o.semantic)
        color_by_label(points);
    return SurfelScene::create(device, points, surfels);
}

Result<CameraPath> load_cameras(const DriveOptions& o)
{
    SR_TRY(const Intrinsics intrinsics, intrinsics_of(o));
    SR_TRY(CameraPath path, read_camera_path(o.path, intrinsics));
    if (o.equirect)
        for (CameraFrame& frame : path.frames)
            frame.intrinsics = whole_sphere(o.width, o.width / 2);
    if (o.rig.empty())
        return path;
    SR_TRY(const Rig rig, read_rig(o.rig));
    return expand_rig(rig, path);
}

uint64_t hash_cameras(const CameraPath& path)
{
    Hash hash;
    for (const CameraFrame& f : path.frames) {
        const Intrinsics& k = f.intrinsics;
        const double view[] = {f.time, k.fx, k.fy, k.cx, k.cy, double(k.width), double(k.height), double(k.model)};
        hash.add(f.camera);
        hash.add(std::as_bytes(std::span(view)));
        hash.add(std::as_bytes(std::span(k.distortion)));
        hash.add(std::as_bytes(std::span(f.pose.world_to_camera)));
    }
    return hash.value();
}

Result<std::vector<SplatImage>> PathRenderer::render(std::span<const CameraFrame> frames)
{
    const Intrinsics& size = frames.front().intrinsics;
    auto& rasterizer = rasterizers_[{size.width, size.height, size.model}];
    if (!rasterizer) {
        RasterizerOptions options = options_;
        options.model = size.model;
        SR_TRY(rasterizer,
               Rasterizer::create(device_, scene_, size.width, size.height, uint32_t(frames.size()), options));
    }
    std::vector<SplatCamera> cameras;
    for (const CameraFrame& frame : frames)
        cameras.push_back(splat_camera(frame.intrinsics, frame.pose));
    return rasterizer->render(cameras);
}

Status render_path(PathRenderer& renderer, const CameraPath& path, const PathCallbacks& callbacks)
{
    for (size_t at = 0; at < path.frames.size();) {
        const size_t end = end_of_moment(path, at);
        SR_TRY(const auto images, renderer.render(std::span(path.frames).subspan(at, end - at)));
        for (size_t i = at; i < end; ++i)
            SR_CHECK(callbacks.drawn(path.frames[i], images[i - at]));
        at = end;
        SR_CHECK(callbacks.moved(at));
    }
    return {};
}

Path camera_folder(const Path& folder, const std::string& camera)
{
    return camera.empty() ? folder : folder / camera;
}

} // namespace semrover
