// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover render GRID --path FILE -o DIR: splat buffers of a trajectory: colour, depth, normal, label, visibility
#include "engine/job/drawing.h"
#include "engine/job/outputs.h"
#include "runtime/base/quote.h"
#include "tools/cli/open_device.h"
#include "tools/cli/picture_options.h"
#include "tools/cli/run_job.h"
#include "tools/cli/session.h"
#include "tools/cli/value_options.h"
#include "tools/commands/scene_input.h"
#include "tools/commands/trajectory_options.h"
#include "tools/commands/video.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct RenderArguments {
    Path grid, output, video;
    std::string profile;
    TrajectoryOptions trajectory;
    SceneInputOptions input;
    PictureEncoding encoding;
    LidarFormat lidar = LidarFormat::npy;
    uint32_t threads = 0;
    int frames_per_second = 10;
    bool top = false, semantic = false, floats = false, points = false, visible_depth = false;
};

Status check_outputs(const RenderArguments& o, const Globals& globals)
{
    if (o.trajectory.path.empty() && !o.top)
        return fail(ErrorCode::usage, "--path (a trajectory) or --top is required");
    if (o.video.empty())
        return {};
    if (o.trajectory.path.empty())
        return fail(ErrorCode::usage, "--video needs --path");
    // where a run is there, the settings say whether it is this one, and whose the video is
    return check_writable(o.video, globals.yes || finished_results(o.output, Json()));
}

// of the first camera, from where the job hands pictures over
struct VideoOfFrames {
    std::optional<Video> video;
    std::string camera;

    Status open(const RenderArguments& o, const CameraFrame& first)
    {
        camera = first.camera;
        SR_TRY(Video made,
               Video::create(o.video, first.intrinsics.width, first.intrinsics.height, o.frames_per_second));
        video.emplace(std::move(made));
        return {};
    }
    Status add(const CameraFrame& frame, std::span<const uint8_t> pixels)
    {
        return video && frame.camera == camera ? video->add(pixels) : Status{};
    }
};

Result<DrawingOptions> drawing_options(const RenderArguments& o, const Globals& globals)
{
    DrawingOptions d;
    SR_TRY(d.draw, draw_options(o.trajectory, o.grid));
    d.draw.semantic = o.semantic;
    d.floats = o.floats;
    d.points = o.points;
    d.visible_depth = o.visible_depth;
    d.encoding = o.encoding;
    d.lidar = o.lidar;
    d.threads = o.threads;
    d.folder = o.output;
    d.replace = globals.yes;
    d.allow_empty = o.trajectory.allow_empty;
    SceneInputOptions scene = o.input;
    scene.origin_may_be_of_path = !o.trajectory.path.empty();
    SR_TRY(SceneInput input, read_scene_input(o.grid, scene));
    print_warnings(input.warnings, globals);
    TrajectoryOptions trajectory = o.trajectory;
    if (trajectory.placement.origin.empty() && !has_origin(input.format))
        trajectory.placement.origin = o.input.origin;
    if (input.grid)
        d.scene = std::move(*input.grid);
    else
        d.scene = std::move(*input.splats);
    d.scene_name = o.grid;
    if (!o.trajectory.path.empty()) {
        SR_TRY(d.path, load_cameras(trajectory));
    }
    if (!o.video.empty())
        SR_CHECK(need_cameras(d.path, "--video"));
    SR_CHECK(check_drawing_outputs(d));
    if (o.top)
        d.top = {o.trajectory.width, o.trajectory.height};
    return d;
}

Status render(const RenderArguments& o, const Globals& globals)
{
    SR_CHECK(check_outputs(o, globals));
    SR_TRY(DrawingOptions options, drawing_options(o, globals));
    SR_TRY(const auto device, open_device(globals, o.profile));
    print_warnings(options.path.warnings, globals);
    VideoOfFrames video;
    const bool finished = finished_results(o.output, Json()) && !globals.yes;
    const bool has_video = finished && is_written(o.video);
    const bool wants_video = !o.video.empty() && !has_video;
    if (wants_video)
        options.picture = [&](const CameraFrame& frame, std::span<const uint8_t> pixels) {
            return video.add(frame, pixels);
        };
    SR_TRY(const Json results, run_job(globals, [&](const JobCallbacks& callbacks) -> Result<std::unique_ptr<Job>> {
               const CameraPath path = options.path;
               SR_TRY(auto job, begin_drawing(*device, std::move(options), callbacks));
               if (wants_video)
                   SR_CHECK(video.open(o, path.frames.front()));
               return job;
           }));
    if (video.video)
        SR_CHECK(video.video->finish());
    SR_CHECK(write_profile(*device, o.profile, globals));
    if (globals.session)
        globals.session->results = results;
    else if (globals.json)
        fmt::print("{}\n", json_text(results));
    return {};
}

} // namespace

void add_render(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<RenderArguments>();
    CLI::App* c =
        app.add_subcommand("render", "splat buffers of a trajectory: colour, depth, normal, label, visibility");
    c->add_option("GRID", o->grid,
                  "a grid (.sgrid, a folder of tiles, .npz, .label, .vox, .ply) or splats (.ply, .glb, .splat)")
        ->required();
    c->add_option("-o,--output", o->output,
                  "folder for {color,depth,normal,label,visible}/000000.png, transforms.json and the run's state")
        ->required();
    add_scene_input_options(*c, o->input);
    add_trajectory_options(*c, o->trajectory);
    c->add_flag("--semantic", o->semantic, "label colours; a grid without points is drawn as blocks");
    c->add_flag("--top", o->top, "also an overview from above, top.png");
    c->add_flag("--npy", o->floats,
                "also float32 arrays {depth_expected,depth_median,alpha}/000000.npy, depths in metres");
    c->add_flag("--points", o->points, "also points.ply, the scene's points, which transforms.json names");
    add_picture_options(*c, o->encoding, o->threads);
    add_depth_option(*c, o->encoding.depth, {std::begin(kDepthFormats), std::end(kDepthFormats)},
                     ", or float32 metres in .npy");
    add_flow_option(*c, o->encoding);
    add_choice(
        *c, "--lidar-format", {std::begin(kLidarFormats), std::end(kLidarFormats)},
        "of the points of a rig's lidars, in LIDAR/points/000000: .npy or .pcd of all fields, KITTI's .bin (x y z "
        "intensity) or nuScenes' .pcd.bin (x y z intensity ring)",
        [o](const std::string& word) {
            o->lidar = LidarFormat(std::ranges::find(kLidarFormats, word) - std::begin(kLidarFormats));
        });
    c->add_flag("--visible-depth", o->visible_depth, "depth pictures are 0 where a pixel is not visible");
    CLI::Option* video =
        c->add_option("--video", o->video, "also an MP4 of the colour frames (of the first camera), through ffmpeg");
    add_number(*c, "--fps", o->frames_per_second, "frames a second of the video", 1, 240)->needs(video);
    c->add_option("--profile", o->profile, "write device times as a Chrome trace");
    c->callback([o, &globals, &run] { run = resuming([o, &globals] { return render(*o, globals); }); });
}

} // namespace semrover
