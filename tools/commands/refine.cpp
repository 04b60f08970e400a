// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover refine DIR|GRID -m MODEL -o OUT: splat buffers to frames, each from the one before or windows of them
#include "engine/job/refine_store.h"
#include "engine/job/refinement.h"
#include "runtime/base/bytes_text.h"
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
#include <optional>

namespace semrover {

namespace {

struct RefineVideos {
    Path frames;       // MP4 of the frames; empty: none
    Path side_by_side; // MP4 of label, buffer and frame beside each other; empty: none
    int frames_per_second = 10;

    bool any() const { return !frames.empty() || !side_by_side.empty(); }
};

// pictures of one height beside each other, rows of [width, 3]
std::vector<uint8_t> joined(std::span<const std::span<const uint8_t>> pictures, const ImageSize& size)
{
    std::vector<uint8_t> out;
    const size_t row = size_t(size.width) * 3;
    for (uint32_t y = 0; y < size.height; ++y)
        for (const auto& picture : pictures)
            out.insert(out.end(), &picture[y * row], &picture[y * row] + row);
    return out;
}

// FILE.mp4, or FILE-CAMERA.mp4 when there are several cameras
Path video_path(const Path& file, const std::string& camera, size_t cameras)
{
    if (cameras == 1)
        return file;
    Path path = file;
    return path.replace_filename(fmt::format("{}-{}{}", file.stem().string(), camera, file.extension().string()));
}

Result<Video> open_video(const Path& file, const RefinedCamera& camera, size_t cameras, uint32_t pictures, int rate)
{
    const ImageSize& size = camera.buffers.size;
    return Video::create(video_path(file, camera.buffers.name, cameras), size.width * pictures, size.height, rate);
}

Status write_camera(const RefineVideos& videos, const RefineStore& store, const RefinedCamera& camera, size_t cameras)
{
    std::optional<Video> plain, beside;
    if (!videos.frames.empty()) {
        SR_TRY(Video video, open_video(videos.frames, camera, cameras, 1, videos.frames_per_second));
        plain.emplace(std::move(video));
    }
    if (!videos.side_by_side.empty()) {
        SR_TRY(Video video, open_video(videos.side_by_side, camera, cameras, 3, videos.frames_per_second));
        beside.emplace(std::move(video));
    }
    for (uint32_t f = camera.range.first; f <= camera.range.last; ++f) {
        SR_TRY(const ImageRgb8 frame, store.load_frame(camera.buffers, f));
        if (plain)
            SR_CHECK(plain->add(frame.pixels));
        if (!beside)
            continue;
        SR_TRY(const std::vector<uint8_t> labels, read_label_picture(camera.buffers, f));
        SR_TRY(const BufferFrame buffer, read_buffer(camera.buffers, f));
        const std::span<const uint8_t> pictures[] = {labels, buffer.color, frame.pixels};
        SR_CHECK(beside->add(joined(pictures, camera.buffers.size)));
    }
    if (plain)
        SR_CHECK(plain->finish());
    return beside ? beside->finish() : Status{};
}

// what write_videos will write: FILE.mp4 each, or FILE-CAMERA.mp4 when there are several cameras
std::vector<Path> video_files(const RefineVideos& videos, std::span<const RefinedCamera> cameras)
{
    std::vector<Path> files;
    for (const Path& video : {videos.frames, videos.side_by_side})
        for (const RefinedCamera& c : cameras)
            if (!video.empty())
                files.push_back(video_path(video, c.name, cameras.size()));
    return files;
}

// from the finished frames of the store
Status write_videos(const RefineVideos& videos, const RefineStore& store, std::span<const RefinedCamera> cameras)
{
    for (const RefinedCamera& camera : cameras)
        if (videos.any())
            SR_CHECK(write_camera(videos, store, camera, cameras.size()));
    return {};
}

struct RefineArguments {
    RefinementOptions options;
    std::string frames;
    RefineVideos videos;
    TrajectoryOptions trajectory;
    std::string profile;
    bool size_given = false, dry_run = false;
};

// "FIRST:LAST", either may be left out
Status parse_frames(const std::string& text, RefinementOptions& o)
{
    if (text.empty())
        return {};
    const size_t colon = text.find(':');
    const std::string parts[] = {text.substr(0, colon), colon == std::string::npos ? "" : text.substr(colon + 1)};
    std::optional<uint32_t>* numbers[] = {&o.first_frame, &o.last_frame};
    for (size_t i = 0; i < 2; ++i) {
        const bool digits = parts[i].size() <= 6 && parts[i].find_first_not_of("0123456789") == std::string::npos;
        if (colon == std::string::npos || !digits)
            return fail(ErrorCode::usage, "--frames takes FIRST:LAST, found {}", quote(text));
        if (!parts[i].empty())
            *numbers[i] = uint32_t(std::stoul(parts[i]));
    }
    return {};
}

Result<Refinement> resolve(const RefineArguments& o, const Globals& globals, const JobCallbacks& callbacks)
{
    if (o.options.output.empty() && !o.dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    RefinementOptions r = o.options;
    SR_CHECK(parse_frames(o.frames, r));
    SR_TRY(r.draw, draw_options(o.trajectory, o.options.input));
    r.radius_given = !o.trajectory.splat_radius.empty();
    if (o.size_given)
        r.size = ImageSize{o.trajectory.width, o.trajectory.height};
    r.allow_empty = o.trajectory.allow_empty;
    if (!o.trajectory.path.empty()) {
        SR_TRY(r.path, load_cameras(o.trajectory));
        SR_CHECK(need_cameras(*r.path, "refine"));
    }
    r.grid = [&o, &globals]() -> Result<VoxelGrid> {
        Result<VoxelGrid> grid = load_grid(o.options.input, {}, globals);
        if (!grid && o.options.input.extension() != ".sgrid") // options that the message may name are convert's
            return fail(grid.error().code, "{} (`semrover convert` makes a .sgrid of it)", grid.error().message);
        return grid;
    };
    r.replace = globals.yes;
    return resolve_refinement(std::move(r), callbacks);
}

// of a renderer of videos
std::string windows_text(const Refinement& r)
{
    size_t windows = 0;
    for (const RefinedCamera& c : r.cameras)
        windows += c.windows.size();
    if (!r.model.video())
        return "";
    return fmt::format("{} window{} of up to {}, ", windows, windows == 1 ? "" : "s", r.settings.shape.frames);
}

void print_plan(const Refinement& r, const MemoryPlan& plan, const Globals& globals)
{
    if (globals.json || globals.quiet || globals.session)
        return;
    const ImageSize& size = r.cameras.front().buffers.size;
    fmt::print("{} frames of {} x {}, {}{} step{} each\nplanned device memory {} bytes ({}), {}\n", r.frames(),
               size.width, size.height, windows_text(r), r.settings.steps, r.settings.steps == 1 ? "" : "s", plan.bytes,
               bytes_text(plan.bytes), policy_name(plan.policy));
    std::fflush(stdout);
}

Status dry_run(Device& device, const Refinement& r, const Globals& globals)
{
    SR_TRY(const MemoryPlan plan, plan_refinement(device, r));
    print_plan(r, plan, globals);
    if (globals.json)
        fmt::print("{}\n", json_text(describe(device, r, plan)));
    return {};
}

void print_results(const RefineArguments& o, const Globals& globals, const Json& results)
{
    const uint64_t peak = results["peak_device_bytes"];
    if (globals.session)
        globals.session->results = results;
    else if (globals.json)
        fmt::print("{}\n", json_text(results));
    else if (!globals.quiet)
        fmt::print("peak device memory {} bytes ({}); frames are in {}\n", peak, bytes_text(peak),
                   quote_path(o.options.output / "frames"));
}

Status refine(const RefineArguments& o, const Globals& globals)
{
    JobDisplay display(globals);
    SR_TRY(Refinement r, resolve(o, globals, display.callbacks()));
    if (!o.dry_run)
        SR_CHECK(r.check_outputs(video_files(o.videos, r.cameras)));
    const bool finished = r.was_finished() && !globals.yes;
    const bool has_videos = finished && std::ranges::all_of(video_files(o.videos, r.cameras), is_written);
    SR_TRY(const auto device, open_device(globals, o.profile));
    if (r.options.path)
        print_warnings(r.options.path->warnings, globals);
    if (o.dry_run)
        return dry_run(*device, r, globals);
    if (globals.session) {
        SR_TRY(r.options.networks, globals.session->renderer(r.options.model, r.options.precision));
    }
    const auto results = run_job(globals, [&](const JobCallbacks& callbacks) {
        RefinementCallbacks c{callbacks, {}, {}};
        c.planned = [&](const Refinement& of, const MemoryPlan& plan) { print_plan(of, plan, globals); };
        c.refined = [&](const RefineStore& store, std::span<const RefinedCamera> cameras) {
            return has_videos ? Status{} : write_videos(o.videos, store, cameras);
        };
        return begin_refinement(*device, std::move(r), c);
    });
    if (!results && results.error().code == ErrorCode::interrupted)
        return fail(ErrorCode::interrupted, "interrupted; what is done is in {}, the same command goes on",
                    quote_path(o.options.output));
    SR_CHECK(results);
    SR_CHECK(write_profile(*device, o.profile, globals));
    print_results(o, globals, *results);
    return {};
}

void add_options(CLI::App& c, RefineArguments& a)
{
    RefinementOptions& o = a.options;
    RendererOptions& r = o.renderer;
    c.add_option("DIR|GRID", o.input, "folder that `semrover render` wrote, or a grid with --path")->required();
    c.add_option("-m,--model", o.model, "model with a renderer: folder, or LDM file")->required();
    c.add_option("-o,--output", o.output, "folder for frames/, latents/ and the run's state");
    add_seed(c, "-s,--seed", r.seed, "noise seed");
    add_number(c, "--steps", r.steps, "denoising steps of a frame", 1, 10000);
    add_number(c, "--cfg-scale", r.guidance_scale,
               "guidance towards the previous frame and what is visible; 1: none; of a window's last frame", 0, 1000);
    add_number(c, "--cfg-first", r.first_guidance_scale, "guidance of a window's first frame; linear in between", 0,
               1000);
    add_number(c, "--window", r.window_frames, "frames that a renderer of videos makes together", 1, kMostWindowFrames);
    add_number(c, "--window-overlap", r.window_overlap, "of these, how many are known from the window before", 0,
               kMostWindowFrames - 1);
    add_number(c, "--decode-frames", r.decode_frames, "frames that its VAE decodes together: less memory with fewer", 1,
               kMostWindowFrames);
    add_choice(c, "--sampler", {"ddim", "dpm++2m", "euler"}, "ddim, dpm++2m or euler",
               [&o](const std::string& text) { o.sampler = *sampler_from_name(text); });
    add_number(c, "--previous-noise", r.previous_noise, "noise on the previous frame's latent", 0, 1000);
    add_choice(
        c, "--frame-noise", {"fresh", "warped"},
        "of a frame: fresh, or warped, as it was on the surfaces of the frame before (wants --path)",
        [&r](const std::string& text) { r.frame_noise = text == "warped" ? FrameNoise::warped : FrameNoise::fresh; });
    add_number(c, "--frame-history", r.frame_history,
               "share of the frame before, where both show the same surface: flickers less (wants --path)", 0,
               kMostFrameHistory);
    add_precision_option(c, o.precision);
    CLI::Option* frames =
        c.add_option("--frames", a.frames, "FIRST:LAST, both included, either may be left out; FIRST is a first frame");
    c.add_option("--from", o.from, "output of an earlier run: FIRST goes on from its latents of the frames before")
        ->needs(frames);
    add_picture_options(c, o.encoding, o.threads);
    add_depth_option(c, o.encoding.depth, {"mm", "cm", "kitti256"}, "; of the buffers of a grid");
    add_flow_option(c, o.encoding);
    c.add_option("--video", a.videos.frames, "also an MP4 of the frames, one per camera, through ffmpeg");
    c.add_option("--side-by-side", a.videos.side_by_side, "also an MP4 of label, buffer and frame");
    add_number(c, "--fps", a.videos.frames_per_second, "frames a second of the videos", 1, 240);
    c.add_option("--profile", a.profile, "write device times as a Chrome trace");
    c.add_flag("--dry-run", a.dry_run, "only say how many frames and how much memory");
    add_trajectory_options(c, a.trajectory);
}

} // namespace

void add_refine(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<RefineArguments>();
    CLI::App* c = app.add_subcommand("refine", "splat buffers to frames, each from the one before or windows of them");
    add_options(*c, *o);
    c->callback([o, c, &globals, &run] {
        o->size_given = c->count("--width") + c->count("--height") > 0;
        run = resuming([o, &globals] { return refine(*o, globals); });
    });
}

} // namespace semrover
