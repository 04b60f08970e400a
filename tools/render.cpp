// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover render GRID --path FILE -o DIR: splat buffers of a camera path: colour, depth, normal, label, visibility
#include "engine/format/image.h"
#include "engine/scene/palette.h"
#include "engine/splat/bounds.h"
#include "runtime/base/quote.h"
#include "runtime/device/profile.h"
#include "tools/cli/commands.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/path_renderer.h"
#include "tools/scene_input.h"
#include "tools/video.h"

#include <CLI/CLI.hpp>
#include <optional>

namespace semrover {

namespace {

struct RenderArguments {
    std::string grid, output, video, profile;
    DriveOptions drive;
    SceneInputOptions input;
    int frames_per_second = 10;
    bool top = false;
};

// straight down from above the middle, x to the right in the picture, with a narrow view so that heights hardly shift
CameraFrame overview_camera(const Bounds& b, uint32_t width, uint32_t height)
{
    const double x = (b.low[0] + b.high[0]) / 2, y = (b.low[1] + b.high[1]) / 2;
    CameraFrame frame;
    frame.intrinsics = pinhole_from_fov(20, width, height);
    const double along = (b.high[0] - b.low[0]) * frame.intrinsics.fx / width; // x runs along the width
    const double across = (b.high[1] - b.low[1]) * frame.intrinsics.fy / height;
    const double up = b.high[2] + 1.05 * std::max(along, across);
    frame.pose.world_to_camera = {1, 0, 0, -x, 0, -1, 0, y, 0, 0, -1, up, 0, 0, 0, 1};
    return frame;
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
    const Path folder = camera_folder(out.folder, frame.camera);
    SR_CHECK(write_frame_images(folder, out.counts[frame.camera]++, image, out.background));
    if (out.video && frame.camera == out.video_camera)
        return out.video->add(color_pixels(image, out.background));
    return {};
}

Status render_drive(const RenderArguments& o, const Globals& globals, Device& device, PathRenderer& renderer,
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
    PathCallbacks callbacks;
    callbacks.drawn = [&](const CameraFrame& frame, const SplatImage& image) { return write_frame(out, frame, image); };
    callbacks.moved = [&](size_t done) -> Status {
        progress.update(done, device.allocated_bytes());
        if (interrupt_requested() && done < path.frames.size())
            return fail(ErrorCode::interrupted, "interrupted after {} frames; they are in {}", done,
                        quote_path(out.folder));
        return {};
    };
    SR_CHECK(render_path(renderer, path, callbacks));
    progress.finish();
    return out.video ? out.video->finish() : Status{};
}

Status render_overview(const RenderArguments& o, const Bounds& bounds, PathRenderer& renderer, const Output& out)
{
    const CameraFrame camera = overview_camera(bounds, o.drive.width, o.drive.height);
    SR_TRY(const auto images, renderer.render({&camera, 1}));
    std::error_code error;
    std::filesystem::create_directories(out.folder, error);
    return write_png_rgb8(out.folder / "top.png", camera.intrinsics.width, camera.intrinsics.height,
                          color_pixels(images[0], out.background));
}

Status check_outputs(const RenderArguments& o, const Globals& globals)
{
    if (o.drive.path.empty() && !o.top)
        return fail(ErrorCode::usage, "--path (a camera path) or --top is required");
    const Path folder = o.output;
    for (const Path& existing : {folder / "color", folder / "top.png"})
        if (std::filesystem::exists(existing) && !globals.yes)
            return fail(ErrorCode::usage, "{} exists; -y replaces pictures there", quote_path(existing));
    if (!o.video.empty() && std::filesystem::exists(o.video) && !globals.yes)
        return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(o.video));
    if (!o.video.empty() && o.drive.path.empty())
        return fail(ErrorCode::usage, "--video needs --path");
    return {};
}

// splats are drawn as they are
Result<SurfelScene> load_scene(const DriveOptions& o, const Path& path, SceneInput& input, Device& device)
{
    if (input.grid)
        return load_scene(o, path, *input.grid, device);
    Surfels& splats = *input.splats;
    for (size_t i = 0; o.semantic && i < splats.label.size(); ++i)
        splats.color[i] = label_color(splats.label[i]);
    return SurfelScene::create(device, splats);
}

Status render(const RenderArguments& o, const Globals& globals)
{
    SR_CHECK(check_outputs(o, globals));
    SR_CHECK(check_drive(o.drive));
    Output out{o.output, {}, {}, {}, {}};
    SR_TRY(out.background, background_of(o.drive));
    SR_TRY(SceneInput input, read_scene_input(o.grid, o.input));
    print_warnings(input.warnings, globals);
    CameraPath path;
    if (!o.drive.path.empty()) {
        SR_TRY(path, load_cameras(o.drive));
    }
    SR_TRY(const auto device, open_device(globals));
    if (!o.profile.empty())
        device->set_profile(std::make_shared<Profile>());
    SR_TRY(const SurfelScene scene, load_scene(o.drive, o.grid, input, *device));
    if (scene.skipped() && !globals.quiet)
        fmt::print(stderr, "semrover: warning: {} of {} splats are degenerate and not drawn\n", scene.skipped(),
                   scene.size());
    RasterizerOptions options;
    options.visible_alpha = o.drive.visible_alpha.value_or(options.visible_alpha);
    PathRenderer renderer(*device, scene, options);
    if (!path.frames.empty())
        SR_CHECK(render_drive(o, globals, *device, renderer, path, out));
    if (o.top)
        SR_CHECK(render_overview(o, input.grid ? bounds_of(*input.grid) : bounds_of(*input.splats), renderer, out));
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
    auto o = std::make_shared<RenderArguments>();
    CLI::App* c =
        app.add_subcommand("render", "splat buffers of a camera path: colour, depth, normal, label, visibility");
    c->add_option("GRID", o->grid,
                  "a grid (.sgrid, a folder of tiles, .npz, .label, .vox, .ply) or splats (.ply, .glb, .splat)")
        ->required();
    c->add_option("-o,--output", o->output, "folder for {color,depth,normal,label,visible}/000000.png")->required();
    add_drive_options(*c, o->drive);
    add_scene_input_options(*c, o->input);
    c->add_flag("--semantic", o->drive.semantic, "label colours; a grid without points is drawn as blocks");
    c->add_flag("--top", o->top, "also an overview from above, top.png");
    c->add_option("--video", o->video, "also an MP4 of the colour frames (of the first camera), through ffmpeg");
    c->add_option("--fps", o->frames_per_second, "frames a second of the video")->check(CLI::Range(1, 240));
    c->add_option("--profile", o->profile, "write device times as a Chrome trace");
    c->callback([o, &globals, &run] { run = [o, &globals] { return render(*o, globals); }; });
}

} // namespace semrover
