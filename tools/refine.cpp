// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover refine DIR|GRID -m MODEL -o OUT: splat buffers to frames, each from the one before
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "runtime/device/profile.h"
#include "tools/cli/open_device.h"
#include "tools/cli/progress.h"
#include "tools/cli/version.h"
#include "tools/path_renderer.h"
#include "tools/refine_video.h"
#include "tools/scene_input.h"

#include <chrono>
#include <CLI/CLI.hpp>
#include <optional>

namespace semrover {

namespace {

namespace fs = std::filesystem;

struct RefineArguments {
    std::string input, model, output, sampler, precision = "fp16", frames, from, format = "png", profile;
    std::string video, side_by_side, frame_noise;
    std::optional<int> steps;
    std::optional<float> cfg_scale, previous_noise;
    uint64_t seed = 0;
    int quality = 92, frames_per_second = 10;
    DriveOptions drive;
    bool size_given = false, dry_run = false;

    bool from_grid() const { return fs::is_regular_file(input); }
    FrameFormat frame_format() const { return {format == "jpeg", quality}; }
};

// everything a run needs before its folder is opened
struct Job {
    const RefineArguments& options;
    const Globals& globals;
    RendererModel model;
    SamplingPlan plan;
    int steps = 0;
    AsdOptions asd;
    FrameNoise frame_noise = FrameNoise::fresh;
    float visible_alpha = 0.5f;
    std::string splat_radius; // as the option takes it
    CameraPath path;          // where one was given
    std::vector<RefineChain> chains;
    std::unique_ptr<Device> device;
    uint64_t render_bytes = 0; // device memory at most while buffers were rendered
    MemoryPlan memory;
};

DType precision_of(const RefineArguments& o)
{
    return o.precision == "fp32" ? DType::f32 : DType::f16;
}

Status resolve_model(Job& j)
{
    const RefineArguments& o = j.options;
    std::optional<Sampler> sampler;
    if (!o.sampler.empty()) {
        SR_TRY(sampler, sampler_from_name(o.sampler));
    }
    SR_TRY(j.model, RendererModel::open(o.model, sampler));
    for (const std::string& warning : j.model.warnings)
        if (!j.globals.quiet)
            fmt::print(stderr, "semrover: warning: {}\n", warning);
    const RendererDefaults& d = j.model.defaults;
    j.steps = o.steps.value_or(d.num_inference_steps);
    j.asd.guidance_scale = o.cfg_scale.value_or(d.guidance_scale);
    j.asd.previous_noise = o.previous_noise.value_or(d.previous_noise);
    j.asd.seed = o.seed;
    j.visible_alpha = o.drive.visible_alpha.value_or(d.visible_threshold);
    j.splat_radius = o.drive.splat_radius;
    if (j.splat_radius.empty())
        j.splat_radius = d.splat_radius ? fmt::format("{}", *d.splat_radius) : "auto";
    SR_TRY(j.plan, plan_sampling(j.model.scheduler, j.steps));
    return {};
}

// "FIRST:LAST", either may be left out
Result<FrameRange> range_of(const std::string& text, const BufferCamera& camera)
{
    FrameRange r{0, camera.frames - 1};
    if (text.empty())
        return r;
    const size_t colon = text.find(':');
    const std::string parts[] = {text.substr(0, colon), colon == std::string::npos ? "" : text.substr(colon + 1)};
    uint32_t* numbers[] = {&r.first, &r.last};
    for (size_t i = 0; i < 2; ++i) {
        const bool digits = parts[i].size() <= 6 && parts[i].find_first_not_of("0123456789") == std::string::npos;
        if (colon == std::string::npos || !digits)
            return fail(ErrorCode::usage, "--frames takes FIRST:LAST, found {}", quote(text));
        if (!parts[i].empty())
            *numbers[i] = uint32_t(std::stoul(parts[i]));
    }
    if (r.first > r.last || r.last >= camera.frames)
        return fail(ErrorCode::usage, "--frames {} is not within 0:{}, the frames{}", text, camera.frames - 1,
                    camera.name.empty() ? "" : " of camera " + quote(camera.name));
    return r;
}

// the cameras, their frames and, with --from, what came before those
Status find_chains(Job& j)
{
    const RefineArguments& o = j.options;
    std::vector<BufferCamera> cameras;
    if (!o.drive.path.empty()) {
        SR_TRY(j.path, load_cameras(o.drive));
    }
    if (o.from_grid()) {
        if (o.drive.path.empty())
            return fail(ErrorCode::usage, "--path is required to refine straight from a grid");
        cameras = path_buffers(Path(o.output) / "buffers", j.path);
    } else {
        SR_TRY(cameras, open_buffers(o.input));
    }
    if (!o.drive.path.empty())
        SR_CHECK(check_against_path(cameras, j.path));
    const uint32_t downscale = j.model.vae.downscale();
    for (const BufferCamera& camera : cameras) {
        const ImageSize wanted{o.drive.width, o.drive.height};
        if (o.size_given && o.drive.path.empty() && camera.size != wanted)
            return fail(ErrorCode::bad_input, "the pictures in {} are {} x {} pixels, -W and -H say {} x {}",
                        quote_path(camera.folder), camera.size.width, camera.size.height, wanted.width, wanted.height);
        RefineChain& chain = j.chains.emplace_back();
        chain.camera = camera;
        chain.size = {camera.size.width, camera.size.height, downscale};
        SR_TRY(chain.range, range_of(o.frames, camera));
        if (o.from.empty() || chain.range.first == 0)
            continue;
        const Path latents = camera.name.empty() ? Path(o.from) / "latents" : Path(o.from) / "latents" / camera.name;
        SR_TRY(chain.before, read_latent(latents / fmt::format("{:06}.safetensors", chain.range.first - 1), chain.size,
                                         j.model.vae.latent_channels));
    }
    return {};
}

// Noise stays on surfaces where it is known where the cameras were: a model that asks for it gets fresh noise without a
// path, an option is refused
Status find_motion(Job& j)
{
    const RefineArguments& o = j.options;
    j.frame_noise = j.model.defaults.frame_noise;
    if (!o.frame_noise.empty())
        j.frame_noise = o.frame_noise == "warped" ? FrameNoise::warped : FrameNoise::fresh;
    if (j.frame_noise == FrameNoise::fresh)
        return {};
    if (o.drive.path.empty()) {
        if (!o.frame_noise.empty())
            return fail(ErrorCode::usage, "--frame-noise warped needs the cameras of the buffers: --path");
        j.frame_noise = FrameNoise::fresh;
        if (!j.globals.quiet)
            fmt::print(stderr, "semrover: warning: without --path the noise does not stay on surfaces, as this model "
                               "wants it: frames will flicker more\n");
        return {};
    }
    for (RefineChain& c : j.chains)
        std::ranges::copy_if(j.path.frames, std::back_inserter(c.cameras),
                             [&](const CameraFrame& f) { return f.camera == c.camera.name; });
    return {};
}

// what the buffers come from
Result<Json> input_json(const Job& j)
{
    const RefineArguments& o = j.options;
    Json cameras = Json::array();
    for (const RefineChain& c : j.chains) {
        Json& camera = cameras.emplace_back(Json{{"name", c.camera.name},
                                                 {"width", c.size.image_width},
                                                 {"height", c.size.image_height},
                                                 {"first_frame", c.range.first},
                                                 {"last_frame", c.range.last}});
        if (!c.before.empty()) {
            Hash hash;
            hash.add(std::as_bytes(std::span(c.before)));
            camera["before"] = hash_text(hash.value());
        }
        if (!o.from_grid()) {
            SR_TRY(const uint64_t hash, hash_pictures(c.camera, {"color", "visible"}, c.range.first, c.range.last));
            camera["buffers"] = hash_text(hash);
        }
        if (!o.from_grid() && j.frame_noise == FrameNoise::warped) {
            SR_TRY(const uint64_t hash, hash_pictures(c.camera, {"depth"}, 0, c.range.last));
            camera["depth"] = hash_text(hash);
        }
    }
    Json input{{"cameras", cameras}};
    if (o.from_grid() || j.frame_noise == FrameNoise::warped)
        input["path"] = hash_text(hash_cameras(j.path)); // as read, whatever files and options it came from
    if (!o.from_grid())
        return input;
    SR_TRY(const uint64_t grid, hash_file(o.input));
    input["grid"] = hash_text(grid);
    input["drive"] = {{"splat_radius", j.splat_radius},
                      {"opacity", o.drive.opacity},
                      {"visible_alpha", j.visible_alpha},
                      {"background", o.drive.background}};
    return input;
}

// everything that decides the bytes of the frames
Result<Json> settings_json(const Job& j)
{
    const RefineArguments& o = j.options;
    SR_TRY(const Json input, input_json(j));
    SR_TRY(const uint64_t model, j.model.hash());
    return Json{{"command", "refine"},
                {"version", kVersion},
                {"device", j.device->name()},
                {"driver", j.device->driver()},
                {"input", input},
                {"model", hash_text(model)},
                {"precision", o.precision},
                {"sampler", std::string(sampler_name(j.model.scheduler.sampler))},
                {"steps", j.steps},
                {"guidance_scale", j.asd.guidance_scale},
                {"previous_noise", j.asd.previous_noise},
                {"frame_noise", j.frame_noise == FrameNoise::warped ? "warped" : "fresh"},
                {"seed", o.seed},
                {"format", o.format},
                {"quality", o.format == "jpeg" ? o.quality : 0}};
}

// OUT/buffers, as `semrover render` would write them, unless an earlier start of this run did
Status render_buffers(Job& j, RunFolder& run)
{
    const RefineArguments& o = j.options;
    for (const Json& entry : run.entries())
        if (entry.is_object() && entry.value("rendered", Json()) == j.path.frames.size())
            return {};
    SR_TRY(const VoxelGrid grid, load_grid(o.input, {}, j.globals));
    SR_TRY(const auto background, background_of(o.drive));
    DriveOptions drive = o.drive;
    drive.splat_radius = j.splat_radius;
    SR_TRY(const SurfelScene scene, load_scene(drive, o.input, grid, *j.device));
    RasterizerOptions options;
    options.visible_alpha = j.visible_alpha;
    PathRenderer renderer(*j.device, scene, options);
    Progress progress(progress_to_stderr(j.globals), "render", "frames", j.path.frames.size());
    std::map<std::string, uint32_t> counts;
    PathCallbacks callbacks;
    callbacks.drawn = [&](const CameraFrame& frame, const SplatImage& image) {
        const Path folder = camera_folder(run.path() / "buffers", frame.camera);
        return write_frame_images(folder, counts[frame.camera]++, image, background);
    };
    callbacks.moved = [&](size_t done) -> Status {
        progress.update(done, j.device->allocated_bytes());
        return interrupt_requested() ? Status(fail(ErrorCode::interrupted, "interrupted")) : Status{};
    };
    SR_CHECK(render_path(renderer, j.path, callbacks));
    progress.finish();
    return run.append({{"rendered", j.path.frames.size()}});
}

// The buffer that copies go through, where the device needs one, exists from here on: plans count it.
Status settle_device(Device& device)
{
    SR_TRY(const auto probe, Buffer::create(device, 256, MemoryKind::device, "probe"));
    const uint32_t word = 0;
    return device.write(probe->slice(), std::as_bytes(std::span(&word, 1)));
}

Status make_memory_plan(Job& j, std::span<const RendererWork> work)
{
    const DType precision = precision_of(j.options);
    const auto unet = Unet::plan(j.model.unet, precision, j.device->limits());
    const auto vae = Vae::plan(j.model.vae, precision, j.device->limits());
    SR_TRY(RendererBytes parts,
           renderer_bytes(j.device->limits(), {*unet, *vae, j.plan, j.model.conditioning_tokens, j.asd.guidance_scale},
                          work));
    SR_TRY(j.memory, plan_memory(std::move(parts), j.device->allocated_bytes(), j.device->budget()));
    return {};
}

size_t frame_count(const Job& j)
{
    size_t frames = 0;
    for (const RefineChain& c : j.chains)
        frames += c.range.count();
    return frames;
}

void print_plan(const Job& j)
{
    if (j.globals.json || j.globals.quiet)
        return;
    const ImageSize& size = j.chains.front().camera.size;
    fmt::print("{} frames of {} x {}, {} steps each\nplanned device memory {} bytes ({}), {}\n", frame_count(j),
               size.width, size.height, j.steps, j.memory.bytes, bytes_text(j.memory.bytes),
               policy_name(j.memory.policy));
    std::fflush(stdout);
}

// as if nothing were done yet
Status plan_whole_run(Job& j)
{
    std::vector<RendererWork> work;
    for (const RefineChain& c : j.chains)
        work.push_back({c.size});
    return make_memory_plan(j, work);
}

Status dry_run(Job& j)
{
    SR_CHECK(plan_whole_run(j));
    print_plan(j);
    if (!j.globals.json)
        return {};
    Json policies;
    for (MemoryPolicy policy : {MemoryPolicy::resident, MemoryPolicy::staged})
        policies[std::string(policy_name(policy))] = j.device->allocated_bytes() + j.memory.parts.peak(policy);
    fmt::print("{}\n", Json{{"frames", frame_count(j)},
                            {"steps", j.steps},
                            {"policy", policy_name(j.memory.policy)},
                            {"planned_device_bytes", j.memory.bytes},
                            {"policies", policies},
                            {"unet_bytes", j.memory.parts.unet},
                            {"vae_bytes", j.memory.parts.vae},
                            {"device", j.device->name()}}
                           .dump());
    return {};
}

RefineVideos videos_of(const RefineArguments& o)
{
    return {o.video, o.side_by_side, o.frames_per_second};
}

bool was_stopped(const RefineArguments& o)
{
    const auto before = read_json(Path(o.output) / "run.json");
    return before && before->is_object() && before->value("state", "") == "running";
}

// what would be replaced is refused now; a run that was stopped may go on
Status check_outputs(const Job& j)
{
    const RefineArguments& o = j.options;
    const Path out = o.output;
    if (j.globals.yes || was_stopped(o))
        return {};
    std::vector<Path> files{out / "run.json", out / "frames", out / "latents"};
    for (const std::string& video : {o.video, o.side_by_side})
        for (const RefineChain& c : j.chains)
            if (!video.empty())
                files.push_back(video_path(video, c.camera.name, j.chains.size()));
    if (o.from_grid())
        files.push_back(out / "buffers");
    for (const Path& file : files)
        if (fs::exists(file))
            return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(file));
    return {};
}

Status finish(Job& j, RunFolder& run, const RefineStore& store, double seconds)
{
    const uint64_t peak = j.device->peak_bytes();
    SR_CHECK(write_videos(videos_of(j.options), store, j.chains));
    Json results{{"output", j.options.output},
                 {"frames", frame_count(j)},
                 {"steps", j.steps},
                 {"seconds", seconds},
                 {"policy", policy_name(j.memory.policy)},
                 {"planned_device_bytes", j.memory.bytes},
                 {"peak_device_bytes", peak}};
    if (j.render_bytes)
        results["render_device_bytes"] = j.render_bytes;
    SR_CHECK(run.finish(results));
    if (j.device->profile())
        SR_CHECK(j.device->profile()->write(j.options.profile));
    if (j.device->profile() && j.globals.verbose)
        fmt::print(stderr, "{}", j.device->profile()->summary());
    if (j.globals.json)
        fmt::print("{}\n", results.dump());
    else if (!j.globals.quiet)
        fmt::print("peak device memory {} bytes ({}); frames are in {}\n", peak, bytes_text(peak),
                   quote_path(Path(j.options.output) / "frames"));
    return {};
}

Status refine_in(Job& j, RunFolder& run)
{
    const auto begin = std::chrono::steady_clock::now();
    if (j.options.from_grid()) {
        SR_CHECK(render_buffers(j, run));
        j.render_bytes = j.device->peak_bytes();
        j.device->reset_peak();
    }
    RefineStore store(run, j.options.frame_format(), j.model.vae.latent_channels);
    Refiner refiner(store, j.chains);
    SR_CHECK(make_memory_plan(j, refiner.work()));
    print_plan(j);
    {
        FrameRenderer renderer(*j.device, j.model, j.plan, precision_of(j.options), j.asd, j.memory.policy);
        SR_CHECK(refiner.run(renderer, store, j.memory.policy, j.plan.rows.size(), *j.device, j.globals));
    }
    return finish(j, run, store, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
}

Status refine(const RefineArguments& o, const Globals& globals)
{
    Job j{o, globals, {}, {}, 0, {}, {}, 0.5f, {}, {}, {}, 0, {}};
    if (o.output.empty() && !o.dry_run)
        return fail(ErrorCode::usage, "-o/--output is required");
    SR_CHECK(check_drive(o.drive));
    SR_CHECK(resolve_model(j));
    SR_CHECK(find_chains(j));
    SR_CHECK(find_motion(j));
    if (!o.dry_run)
        SR_CHECK(check_outputs(j));
    SR_TRY(j.device, open_device(globals));
    if (!o.profile.empty())
        j.device->set_profile(std::make_shared<Profile>());
    SR_CHECK(settle_device(*j.device));
    j.device->reset_peak();
    if (o.dry_run)
        return dry_run(j);
    if (!was_stopped(o))
        SR_CHECK(plan_whole_run(j)); // what does not fit is refused before anything is replaced
    SR_TRY(const Json settings, settings_json(j));
    RunContents contents{{"encoded"}, {"latents", "frames"}};
    if (o.from_grid())
        contents.results.push_back("buffers");
    SR_TRY(RunFolder run, open_run(o.output, settings, globals.yes, contents));
    const Status status = refine_in(j, run);
    if (!status && status.error().code == ErrorCode::interrupted)
        return fail(ErrorCode::interrupted, "interrupted; what is done is in {}, the same command goes on",
                    quote_path(o.output));
    if (!status)
        run.drop_if_empty();
    return status;
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
