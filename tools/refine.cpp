// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover refine DIR|GRID -m MODEL -o OUT: splat buffers to frames, each from the one before
#include "engine/job/refinement.h"
#include "runtime/base/bytes_text.h"
#include "runtime/base/quote.h"
#include "runtime/device/profile.h"
#include "tools/cli/open_device.h"
#include "tools/cli/run_job.h"
#include "tools/drive_options.h"
#include "tools/refine_video.h"
#include "tools/scene_input.h"

#include <CLI/CLI.hpp>

namespace semrover {

namespace {

struct RefineArguments {
    std::string input, model, output, sampler, precision = "fp16", frames, from, format = "png", profile;
    std::string video, side_by_side, frame_noise;
    std::optional<int> steps;
    std::optional<float> cfg_scale, previous_noise;
    uint64_t seed = 0;
    int quality = 92, frames_per_second = 10;
    DriveOptions drive;
    bool size_given = false, dry_run = false;
};

Result<RefinementOptions> refinement_options(const RefineArguments& o, const Globals& globals)
{
    if (o.output.empty() && !o.dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    RefinementOptions r;
    SR_TRY(r.draw, draw_options(o.drive));
    r.radius_given = !o.drive.splat_radius.empty();
    r.input = o.input;
    r.model = o.model;
    r.output = o.output;
    if (!o.sampler.empty()) {
        SR_TRY(r.sampler, sampler_from_name(o.sampler));
    }
    r.steps = o.steps;
    r.guidance_scale = o.cfg_scale;
    r.previous_noise = o.previous_noise;
    if (!o.frame_noise.empty())
        r.frame_noise = o.frame_noise == "warped" ? FrameNoise::warped : FrameNoise::fresh;
    r.seed = o.seed;
    r.precision = o.precision == "fp32" ? DType::f32 : DType::f16;
    r.frames = o.frames;
    r.from = o.from;
    r.format = {o.format == "jpeg", o.quality};
    if (o.size_given)
        r.size = ImageSize{o.drive.width, o.drive.height};
    if (!o.drive.path.empty()) {
        SR_TRY(r.path, load_cameras(o.drive));
    }
    r.grid = [&o, &globals] { return load_grid(o.input, {}, globals); };
    r.replace = globals.yes;
    return r;
}

void print_plan(const Refinement& r, const MemoryPlan& plan, const Globals& globals)
{
    if (globals.json || globals.quiet)
        return;
    const ImageSize& size = r.chains.front().camera.size;
    fmt::print("{} frames of {} x {}, {} steps each\nplanned device memory {} bytes ({}), {}\n", r.frames(), size.width,
               size.height, r.steps, plan.bytes, bytes_text(plan.bytes), policy_name(plan.policy));
    std::fflush(stdout);
}

Status dry_run(Device& device, const Refinement& r, const Globals& globals)
{
    SR_TRY(const MemoryPlan plan, plan_refinement(device, r));
    print_plan(r, plan, globals);
    if (!globals.json)
        return {};
    Json policies;
    for (MemoryPolicy policy : {MemoryPolicy::resident, MemoryPolicy::staged})
        policies[std::string(policy_name(policy))] = device.allocated_bytes() + plan.parts.peak(policy);
    fmt::print("{}\n", Json{{"frames", r.frames()},
                            {"steps", r.steps},
                            {"policy", policy_name(plan.policy)},
                            {"planned_device_bytes", plan.bytes},
                            {"policies", policies},
                            {"unet_bytes", plan.parts.unet},
                            {"vae_bytes", plan.parts.vae},
                            {"device", device.name()}}
                           .dump());
    return {};
}

std::vector<Path> video_files(const RefineVideos& videos, std::span<const RefineChain> chains)
{
    std::vector<Path> files;
    for (const Path& video : {videos.frames, videos.side_by_side})
        for (const RefineChain& c : chains)
            if (!video.empty())
                files.push_back(video_path(video, c.camera.name, chains.size()));
    return files;
}

Status print_results(const RefineArguments& o, const Globals& globals, Device& device, const Json& results)
{
    if (device.profile())
        SR_CHECK(device.profile()->write(o.profile));
    if (device.profile() && globals.verbose)
        fmt::print(stderr, "{}", device.profile()->summary());
    const uint64_t peak = results["peak_device_bytes"];
    if (globals.json)
        fmt::print("{}\n", results.dump());
    else if (!globals.quiet)
        fmt::print("peak device memory {} bytes ({}); frames are in {}\n", peak, bytes_text(peak),
                   quote_path(Path(o.output) / "frames"));
    return {};
}

Status refine(const RefineArguments& o, const Globals& globals)
{
    SR_TRY(RefinementOptions options, refinement_options(o, globals));
    JobDisplay display(globals);
    SR_TRY(Refinement r, resolve_refinement(std::move(options), display.callbacks()));
    const RefineVideos videos{o.video, o.side_by_side, o.frames_per_second};
    if (!o.dry_run)
        SR_CHECK(r.check_outputs(video_files(videos, r.chains)));
    SR_TRY(const auto device, open_device(globals));
    if (!o.profile.empty())
        device->set_profile(std::make_shared<Profile>());
    if (o.dry_run)
        return dry_run(*device, r, globals);
    const auto results = run_job(globals, [&](const JobCallbacks& callbacks) {
        RefinementCallbacks c{callbacks, {}, {}};
        c.planned = [&](const Refinement& of, const MemoryPlan& plan) { print_plan(of, plan, globals); };
        c.refined = [&](const RefineStore& store, std::span<const RefineChain> chains) {
            return write_videos(videos, store, chains);
        };
        return begin_refinement(*device, std::move(r), c);
    });
    if (!results && results.error().code == ErrorCode::interrupted)
        return fail(ErrorCode::interrupted, "interrupted; what is done is in {}, the same command goes on",
                    quote_path(o.output));
    SR_CHECK(results);
    return print_results(o, globals, *device, *results);
}

void add_options(CLI::App* c, RefineArguments& o)
{
    c->add_option("DIR|GRID", o.input, "folder that `semrover render` wrote, or a grid with --path")->required();
    c->add_option("-m,--model", o.model, "model with a renderer: folder, or LDM file")->required();
    c->add_option("-o,--output", o.output, "folder for frames/, latents/ and the run's state");
    c->add_option("-s,--seed", o.seed, "noise seed");
    c->add_option("--steps", o.steps, "denoising steps of a frame");
    c->add_option("--cfg-scale", o.cfg_scale, "guidance towards the previous frame and what is visible; 1: none");
    c->add_option("--sampler", o.sampler, "ddim or dpm++2m")->check(CLI::IsMember({"ddim", "dpm++2m"}));
    c->add_option("--previous-noise", o.previous_noise, "noise on the previous frame's latent");
    c->add_option("--frame-noise", o.frame_noise,
                  "of a frame: fresh, or warped, as it was on the surfaces of the frame before (wants --path)")
        ->check(CLI::IsMember({"fresh", "warped"}));
    c->add_option("--precision", o.precision, "storage of weights and activations")
        ->check(CLI::IsMember({"fp16", "fp32"}));
    c->add_option("--frames", o.frames, "FIRST:LAST, both included, either may be left out; FIRST is a first frame");
    c->add_option("--from", o.from, "output of an earlier run: FIRST goes on from its latent of the frame before");
    c->add_option("--format", o.format, "of the frames")->check(CLI::IsMember({"png", "jpeg"}));
    c->add_option("--quality", o.quality, "of JPEG frames")->check(CLI::Range(1, 100));
    c->add_option("--video", o.video, "also an MP4 of the frames, one per camera, through ffmpeg");
    c->add_option("--side-by-side", o.side_by_side, "also an MP4 of label, buffer and frame");
    c->add_option("--fps", o.frames_per_second, "frames a second of the videos")->check(CLI::Range(1, 240));
    c->add_option("--profile", o.profile, "write device times as a Chrome trace");
    c->add_flag("--dry-run", o.dry_run, "only say how many frames and how much memory");
    add_drive_options(*c, o.drive);
}

} // namespace

void add_refine(CLI::App& app, const Globals& globals, Run& run)
{
    auto o = std::make_shared<RefineArguments>();
    CLI::App* c = app.add_subcommand("refine", "splat buffers to frames, each from the one before");
    add_options(c, *o);
    c->callback([o, c, &globals, &run] {
        o->size_given = c->count("--width") + c->count("--height") > 0;
        run = [o, &globals] { return refine(*o, globals); };
    });
}

} // namespace semrover
