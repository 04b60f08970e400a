// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover render GRID --path FILE -o DIR: splat buffers of a camera path: colour, depth, normal, label, visibility
#include "engine/render/frame_images.h"
#include "engine/scene/bounds.h"
#include "engine/scene/camera_path.h"
#include "engine/scene/image.h"
#include "engine/scene/rig.h"
#include "engine/splat/blocks.h"
#include "engine/splat/rasterizer.h"
#include "runtime/profile.h"
#include "runtime/quote.h"
#include "tools/commands.h"
#include "tools/open_device.h"
#include "tools/progress.h"
#include "tools/video.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <map>
#include <optional>

namespace semrover {

namespace {

struct Options {
    std::string grid, path, output, rig, video, splat_radius = "0.04", background = "0,0,0", profile;
    uint32_t width = 616, height = 424;
    double fov = 73.0; // degrees: the focal length of the reference pictures, 420 pixels at a width of 616
    float opacity = 1, visible_alpha = 0.5f;
    int frames_per_second = 10;
    bool semantic = false, top = false;
};

Result<SurfelOptions> surfel_options(const Options& o)
{
    SurfelOptions s;
    s.opacity = o.opacity;
    s.auto_sigma = o.splat_radius == "auto";
    if (s.auto_sigma)
        return s;
    char* end = nullptr;
    s.sigma = std::strtof(o.splat_radius.c_str(), &end);
    if (*end || !(s.sigma > 0 && s.sigma < 100))
        return fail(ErrorCode::usage, "--splat-radius takes metres (0..100) or auto, not '{}'", o.splat_radius);
    return s;
}

Result<std::array<uint8_t, 3>> background_of(const Options& o)
{
    unsigned r, g, b;
    int used = 0;
    if (std::sscanf(o.background.c_str(), "%u,%u,%u%n", &r, &g, &b, &used) != 3 ||
        size_t(used) != o.background.size() || r > 255 || g > 255 || b > 255)
        return fail(ErrorCode::usage, "--background takes R,G,B in 0..255, not '{}'", o.background);
    return std::array<uint8_t, 3>{uint8_t(r), uint8_t(g), uint8_t(b)};
}

// points as generated; a grid without points, or --semantic, in label colours
Result<SurfelScene> load_scene(const Options& o, const VoxelGrid& grid, Device& device)
{
    SR_TRY(const SurfelOptions surfels, surfel_options(o));
    ScenePoints points = points_of(grid);
    if (points.size() == 0 && !o.semantic)
        return fail(ErrorCode::bad_input, "{} has no points yet: generate them, or draw its labels with --semantic",
                    quote_path(o.grid));
    if (points.size() == 0)
        return SurfelScene::create(device, block_surfels(grid));
    if (o.semantic)
        color_by_label(points);
    return SurfelScene::create(device, points, surfels);
}

Result<CameraPath> load_cameras(const Options& o)
{
    const Intrinsics intrinsics = pinhole_from_fov(o.fov, o.width, o.height);
    SR_TRY(const CameraPath path, read_camera_path(o.path, intrinsics));
    if (o.rig.empty())
        return path;
    SR_TRY(const Rig rig, read_rig(o.rig));
    return expand_rig(rig, path);
}

// straight down from above the middle, x to the right in the picture, with a narrow view so that heights hardly shift
CameraFrame overview_camera(const VoxelGrid& grid, uint32_t width, uint32_t height)
{
    const Bounds b = bounds_of(grid);
    const double x = (b.low[0] + b.high[0]) / 2, y = (b.low[1] + b.high[1]) / 2;
    CameraFrame frame;
    frame.intrinsics = pinhole_from_fov(20, width, height);
    const double along = (b.high[0] - b.low[0]) * frame.intrinsics.fx / width; // x runs along the width
    const double across = (b.high[1] - b.low[1]) * frame.intrinsics.fy / height;
    const double up = b.high[2] + 1.05 * std::max(along, across);
    frame.pose.world_to_camera = {1, 0, 0, -x, 0, -1, 0, y, 0, 0, -1, up, 0, 0, 0, 1};
    return frame;
}

// frames of one moment are drawn in one submit, with one rasterizer for each image size
class PathRenderer {
  public:
    PathRenderer(Device& device, const SurfelScene& scene, const RasterizerOptions& options)
        : device_(device), scene_(scene), options_(options)
    {
    }

    Result<std::vector<SplatImage>> render(std::span<const CameraFrame> frames)
    {
        const Intrinsics& size = frames.front().intrinsics;
        auto& rasterizer = rasterizers_[{size.width, size.height}];
        if (!rasterizer) {
            SR_TRY(rasterizer,
                   Rasterizer::create(device_, scene_, size.width, size.height, uint32_t(frames.size()), options_));
        }
        std::vector<SplatCamera> cameras;
        for (const CameraFrame& frame : frames)
            cameras.push_back(splat_camera(frame.intrinsics, frame.pose));
        return rasterizer->render(cameras);
    }

  private:
    Device& device_;
    const SurfelScene& scene_;
    RasterizerOptions options_;
    std::map<std::pair<uint32_t, uint32_t>, std::unique_ptr<Rasterizer>> rasterizers_;
};

// end of the run of frames from `first` with the same time and size
size_t end_of_moment(const CameraPath& path, size_t first)
{
    const CameraFrame& a = path.frames[first];
    size_t end = first + 1;
    for (; end < path.frames.size(); ++end) {
        const CameraFrame& b = path.frames[end];
        if (b.time != a.time || b.camera == a.camera || b.intrinsics.width != a.intrinsics.width ||
            b.intrinsics.height != a.intrinsics.height)
            break;
    }
    return end;
}

struct Output {
    Path folder;
    std::array<uint8_t, 3> background;
    std::map<std::string, uint32_t> counts; // frames so far, per camera
    std::optional<Video> video;
    std::string video_camera;
};

Status write_frame(Output& out, const CameraFrame& frame, const SplatImage& image)
{
    const Path folder = frame.camera.empty() ? out.folder : out.folder / frame.camera;
    SR_CHECK(write_frame_images(folder, out.counts[frame.camera]++, image, out.background));
    if (out.video && frame.camera == out.video_camera)
        return out.video->add(color_pixels(image, out.background));
    return {};
}

Status render_path(const Options& o, const Globals& globals, Device& device, PathRenderer& renderer,
                   const CameraPath& path, Output& out)
{
    if (!o.video.empty()) {
        const CameraFrame& first = path.frames.front();
        out.video_camera = first.camera;
        SR_TRY(Video video,
               Video::create(o.video, first.intrinsics.width, first.intrinsics.height, o.frames_per_second));
        out.video.emplace(std::move(video));
    }
    Progress progress(progress_to_stderr(globals), "render", "frames", path.frames.size());
    for (size_t at = 0; at < path.frames.size();) {
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted after {} frames; they are in {}", at,
                        quote_path(out.folder));
        const size_t end = end_of_moment(path, at);
        SR_TRY(const auto images, renderer.render(std::span(path.frames).subspan(at, end - at)));
        for (size_t i = at; i < end; ++i)
            SR_CHECK(write_frame(out, path.frames[i], images[i - at]));
        at = end;
        progress.update(at, device.allocated_bytes());
    }
    progress.finish();
    return out.video ? out.video->finish() : Status{};
}

Status render_overview(const Options& o, const VoxelGrid& grid, PathRenderer& renderer, const Output& out)
{
    const CameraFrame camera = overview_camera(grid, o.width, o.height);
    SR_TRY(const auto images, renderer.render({&camera, 1}));
    std::error_code error;
    std::filesystem::create_directories(out.folder, error);
    return write_png_rgb8(out.folder / "top.png", o.width, o.height, color_pixels(images[0], out.background));
}

Status check_outputs(const Options& o, const Globals& globals)
{
    if (o.path.empty() && !o.top)
        return fail(ErrorCode::usage, "--path (a camera path) or --top is required");
    const Path folder = o.output;
    for (const Path& existing : {folder / "color", folder / "top.png"})
        if (std::filesystem::exists(existing) && !globals.yes)
            return fail(ErrorCode::usage, "{} exists; -y replaces pictures there", quote_path(existing));
    if (!o.video.empty() && std::filesystem::exists(o.video) && !globals.yes)
        return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(o.video));
    if (!o.video.empty() && o.path.empty())
        return fail(ErrorCode::usage, "--video needs --path");
    return {};
}

Status render(const Options& o, const Globals& globals)
{
    SR_CHECK(check_outputs(o, globals));
    SR_CHECK(surfel_options(o).map([](const auto&) {}));
    Output out{o.output, {}, {}, {}, {}};
    SR_TRY(out.background, background_of(o));
    SR_TRY(const VoxelGrid grid, read_grid(o.grid));
    CameraPath path;
    if (!o.path.empty()) {
        SR_TRY(path, load_cameras(o));
    }
    SR_TRY(const auto device, open_device(globals));
    if (!o.profile.empty())
        device->set_profile(std::make_shared<Profile>());
    SR_TRY(const SurfelScene scene, load_scene(o, grid, *device));
    if (scene.skipped() && !globals.quiet)
        fmt::print(stderr, "semrover: warning: {} of {} splats are degenerate and not drawn\n", scene.skipped(),
                   scene.size());
    RasterizerOptions options;
    options.visible_alpha = o.visible_alpha;
    PathRenderer renderer(*device, scene, options);
    if (!path.frames.empty())
        SR_CHECK(render_path(o, globals, *device, renderer, path, out));
    if (o.top)
        SR_CHECK(render_overview(o, grid, renderer, out));
    if (device->profile())
        SR_CHECK(device->profile()->write(o.profile));
    if (device->profile() && globals.verbose)
        fmt::print(stderr, "{}", device->profile()->summary());
    if (globals.json)
        fmt::print("{}\n", Json{{"frames", path.frames.size()},
                                {"splats", scene.size()},
                                {"skipped", scene.skipped()},
                                {"peak_device_bytes", device->peak_bytes()}}
                               .dump());
    return {};
}

} // namespace

void add_render(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<Options>();
    CLI::App* c =
        app.add_subcommand("render", "splat buffers of a camera path: colour, depth, normal, label, visibility");
    c->add_option("GRID", o->grid, ".sgrid")->required();
    c->add_option("--path", o->path, "camera path: TUM, or nerfstudio transforms.json");
    c->add_option("-o,--output", o->output, "folder for {color,depth,normal,label,visible}/000000.png")->required();
    c->add_option("-W,--width", o->width, "pixels")->check(CLI::Range(1u, 16384u));
    c->add_option("-H,--height", o->height, "pixels")->check(CLI::Range(1u, 16384u));
    c->add_option("--fov-x", o->fov, "horizontal field of view in degrees, where the path has no intrinsics")
        ->check(CLI::Range(1.0, 170.0));
    c->add_option("--rig", o->rig, "rig.json: every sensor at every pose, in folders of their names");
    c->add_option("--splat-radius", o->splat_radius,
                  "standard deviation of a splat in metres, or auto: from the spacing of the points");
    c->add_option("--opacity", o->opacity, "of every splat")->check(CLI::Range(0.01f, 1.f));
    c->add_option("--visible-alpha", o->visible_alpha, "alpha from which a pixel counts as visible")
        ->check(CLI::Range(0.f, 1.f));
    c->add_option("--background", o->background, "R,G,B behind the splats");
    c->add_flag("--semantic", o->semantic, "label colours; a grid without points is drawn as blocks");
    c->add_flag("--top", o->top, "also an overview from above, top.png");
    c->add_option("--video", o->video, "also an MP4 of the colour frames (of the first camera), through ffmpeg");
    c->add_option("--fps", o->frames_per_second, "frames a second of the video")->check(CLI::Range(1, 240));
    c->add_option("--profile", o->profile, "write device times as a Chrome trace");
    c->callback([o, &globals, &run] { run = [o, &globals] { return render(*o, globals); }; });
}

} // namespace semrover
