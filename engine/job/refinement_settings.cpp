// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/camera_path.h"
#include "engine/job/input_hashes.h"
#include "engine/job/outputs.h"
#include "engine/job/refinement.h"
#include "engine/job/version.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// a renderer that makes each frame from the one before
Status set_frame_renderer(Refinement& r)
{
    const RefinementOptions& o = r.options;
    if (o.first_guidance_scale || o.window_frames || o.window_overlap || o.decode_frames)
        return fail(ErrorCode::usage, "{}: this renderer makes frames one by one, and has no windows of them",
                    quote_path(o.model));
    r.asd.guidance_scale = o.guidance_scale.value_or(r.model.defaults.guidance_scale);
    r.asd.previous_noise = o.previous_noise.value_or(r.model.defaults.previous_noise);
    r.asd.seed = o.seed;
    r.frame_history = o.frame_history.value_or(r.model.defaults.frame_history);
    if (!(r.frame_history >= 0 && r.frame_history <= kMostFrameHistory))
        return fail(ErrorCode::usage, "a share of {} of the frame before, expected 0 to {}", r.frame_history,
                    kMostFrameHistory);
    return {};
}

// one that makes windows of frames
Status set_video_renderer(Refinement& r)
{
    const RefinementOptions& o = r.options;
    const VideoDefaults& d = r.model.defaults.video;
    if (o.previous_noise)
        return fail(ErrorCode::usage, "{}: a renderer of videos puts no noise on the frame before",
                    quote_path(o.model));
    if (o.frame_history.value_or(0) > 0)
        return fail(ErrorCode::usage, "{}: a renderer of videos takes no share of the frame before",
                    quote_path(o.model));
    r.vsd.first_guidance = o.first_guidance_scale.value_or(d.first_guidance_scale);
    r.vsd.last_guidance = o.guidance_scale.value_or(r.model.defaults.guidance_scale);
    r.vsd.seed = o.seed;
    WindowShape& s = r.shape;
    s.frames = o.window_frames.value_or(d.window_frames);
    if (s.frames < 1 || s.frames > kMostWindowFrames)
        return fail(ErrorCode::usage, "a window of {} frames, expected 1 to {}", s.frames, kMostWindowFrames);
    s.overlap = o.window_overlap.value_or(std::min(d.window_overlap, s.frames - 1));
    r.vsd.correlation = d.frame_correlation;
    if (s.overlap >= s.frames)
        return fail(ErrorCode::usage, "windows of {} frames cannot overlap by {}", s.frames, s.overlap);
    s.decode_frames = std::min(o.decode_frames.value_or(d.decode_frames), s.frames);
    if (s.decode_frames < 1)
        return fail(ErrorCode::usage, "no frame is decoded at a time, expected 1 or more");
    if (!o.from.empty() && s.overlap == 0)
        return fail(ErrorCode::usage, "--from needs windows that overlap: they know nothing of the frames before them");
    return {};
}

} // namespace

Result<Refinement> open_renderer(RefinementOptions options, const JobCallbacks& callbacks)
{
    Refinement r;
    r.options = std::move(options);
    const RefinementOptions& o = r.options;
    SR_TRY(r.model, RendererModel::open(o.model, o.sampler));
    for (const std::string& warning : r.model.warnings)
        if (callbacks.warning)
            callbacks.warning(warning);
    const RendererDefaults& d = r.model.defaults;
    r.steps = o.steps.value_or(d.num_inference_steps);
    r.frame_noise = o.frame_noise.value_or(d.frame_noise);
    SR_CHECK(r.model.video() ? set_video_renderer(r) : set_frame_renderer(r));
    r.draw = o.draw;
    r.draw.visible_alpha = o.draw.visible_alpha.value_or(d.visible_threshold);
    if (!o.radius_given) {
        r.draw.surfels.auto_sigma = !d.splat_radius;
        r.draw.surfels.sigma = d.splat_radius.value_or(r.draw.surfels.sigma);
    }
    SR_TRY(r.plan, plan_sampling(r.model.scheduler, r.steps));
    return r;
}

namespace {

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

Result<std::vector<BufferCamera>> cameras_of(const RefinementOptions& o)
{
    if (o.from_grid() && !o.path)
        return fail(ErrorCode::usage, "--path is required to refine straight from a grid");
    if (o.from_grid())
        return path_buffers(o.output / "buffers", *o.path);
    return open_buffers(o.input);
}

// the windows of a chain's frames and, with --from, the latents of frames before those
Status find_windows(const Refinement& r, RefineChain& chain)
{
    const uint32_t first = chain.range.first;
    const bool goes_on = !r.options.from.empty() && first > 0;
    const uint32_t most = r.model.video() ? std::min(first, r.shape.frames - 1) : 0;
    chain.windows = frame_windows(chain.range, goes_on ? most : 0, r.shape.frames, r.shape.overlap);
    if (!goes_on)
        return {};
    const Path latents = r.options.from / "latents" / chain.camera.name;
    for (uint32_t f = r.model.video() ? chain.windows.front().first : first - 1; f < first; ++f) {
        SR_TRY(const std::vector<float> latent,
               read_latent(latents / fmt::format("{:06}.safetensors", f), chain.size, r.model.vae.latent_channels));
        chain.before.insert(chain.before.end(), latent.begin(), latent.end());
    }
    return {};
}

// the path that lies beside buffers, if it is theirs
void take_path_beside(RefinementOptions& o, std::span<const BufferCamera> cameras, const JobCallbacks& callbacks)
{
    const Path file = o.input / "transforms.json";
    if (!is_file(file))
        return;
    Result<CameraPath> path = read_transforms(file);
    const Status fits = path ? check_against_path(cameras, *path) : tl::make_unexpected(path.error());
    if (fits)
        o.path = std::move(*path);
    else if (callbacks.warning)
        callbacks.warning(fmt::format("{} is not used: {}", quote_path(file), fits.error().message));
}

// the cameras, their frames and, with --from, what came before those
Status find_chains(Refinement& r, const JobCallbacks& callbacks)
{
    const RefinementOptions& o = r.options;
    SR_TRY(const std::vector<BufferCamera> cameras, cameras_of(o));
    const bool path_given = o.path.has_value();
    if (path_given)
        SR_CHECK(check_against_path(cameras, *o.path));
    else
        take_path_beside(r.options, cameras, callbacks);
    for (const BufferCamera& camera : cameras) {
        if (o.size && !path_given && camera.size != *o.size)
            return fail(ErrorCode::bad_input, "the pictures in {} are {} x {} pixels, -W and -H say {} x {}",
                        quote_path(camera.folder), camera.size.width, camera.size.height, o.size->width,
                        o.size->height);
        RefineChain& chain = r.chains.emplace_back();
        chain.camera = camera;
        chain.size = {camera.size.width, camera.size.height, r.model.vae.downscale()};
        chain.shape = r.shape;
        SR_TRY(chain.range, range_of(o.frames, camera));
        SR_CHECK(find_windows(r, chain));
    }
    return {};
}

// with --from, the frame that an earlier run finished before the range: where it is there without a loss
Status find_picture_before(const Refinement& r, RefineChain& chain)
{
    if (chain.before.empty())
        return {};
    const Path picture =
        r.options.from / "frames" / chain.camera.name / fmt::format("{:06}.png", chain.range.first - 1);
    if (!fs::exists(picture))
        return {};
    SR_TRY(const ImageRgb8 image, read_png_rgb8(picture));
    if (image.width != chain.size.image_width || image.height != chain.size.image_height)
        return fail(ErrorCode::bad_input, "{}: {} x {} pixels, expected {} x {}", quote_path(picture), image.width,
                    image.height, chain.size.image_width, chain.size.image_height);
    chain.picture_before = image.pixels;
    return {};
}

// Which surfaces frames share is known where the cameras are: without a path a model that asks for it does without, an
// option is refused
Status find_motion(Refinement& r, const JobCallbacks& callbacks)
{
    const RefinementOptions& o = r.options;
    if (!r.follows_surfaces())
        return {};
    if (!o.path) {
        if (o.frame_noise == FrameNoise::warped)
            return fail(ErrorCode::usage, "--frame-noise warped needs the cameras of the buffers: --path");
        if (o.frame_history.value_or(0) > 0)
            return fail(ErrorCode::usage, "--frame-history needs the cameras of the buffers: --path");
        r.frame_noise = FrameNoise::fresh;
        r.frame_history = 0;
        if (callbacks.warning)
            callbacks.warning("without --path it is not known which surfaces frames share, as this model wants it: "
                              "frames will flicker more");
        return {};
    }
    for (RefineChain& c : r.chains) {
        c.warped_noise = r.frame_noise == FrameNoise::warped;
        c.history = r.frame_history;
        std::ranges::copy_if(o.path->frames, std::back_inserter(c.cameras),
                             [&](const CameraFrame& f) { return f.camera == c.camera.name; });
        if (c.history > 0)
            SR_CHECK(find_picture_before(r, c));
    }
    return {};
}

Result<Json> chain_json(const Refinement& r, const RefineChain& c)
{
    Json camera{{"name", c.camera.name},
                {"width", c.size.image_width},
                {"height", c.size.image_height},
                {"first_frame", c.range.first},
                {"last_frame", c.range.last}};
    if (!c.before.empty()) {
        Hash hash;
        hash.add(std::as_bytes(std::span(c.before)));
        hash.add(std::as_bytes(std::span(c.picture_before)));
        camera["before"] = hash_text(hash.value());
    }
    if (r.options.from_grid())
        return camera;
    const uint32_t first = std::min(c.range.first, c.windows.front().first); // the first that a window sees
    SR_TRY(const uint64_t buffers, hash_pictures(c.camera, {"color", "visible"}, first, c.range.last));
    camera["buffers"] = hash_text(buffers);
    if (r.follows_surfaces()) {
        SR_TRY(const uint64_t depth, hash_pictures(c.camera, {"depth"}, 0, c.range.last));
        camera["depth"] = hash_text(depth);
    }
    return camera;
}

// what the buffers come from
Result<Json> input_json(const Refinement& r)
{
    const RefinementOptions& o = r.options;
    Json cameras = Json::array();
    for (const RefineChain& c : r.chains) {
        SR_TRY(Json camera, chain_json(r, c));
        cameras.push_back(std::move(camera));
    }
    Json input{{"cameras", cameras}};
    if (o.from_grid() || r.follows_surfaces())
        input["path"] = hash_text(hash_cameras(*o.path)); // as read, whatever files and options it came from
    if (!o.from_grid())
        return input;
    SR_TRY(const uint64_t grid, hash_file(o.input));
    input["grid"] = hash_text(grid);
    input["drive"] = drawing_json(r.draw);
    return input;
}

Json shape_json(const WindowShape& s)
{
    return {{"window_frames", s.frames}, {"window_overlap", s.overlap}, {"decode_frames", s.decode_frames}};
}

// what of a renderer of videos decides its frames
Json video_settings(const Refinement& r)
{
    Json settings = shape_json(r.shape);
    settings["guidance_scale"] = r.vsd.last_guidance;
    settings["first_guidance_scale"] = r.vsd.first_guidance;
    settings["frame_correlation"] = r.vsd.correlation;
    settings["added_time_ids"] = r.model.defaults.video.added_numbers;
    return settings;
}

} // namespace

Result<Refinement> resolve_refinement(RefinementOptions options, const JobCallbacks& callbacks)
{
    SR_TRY(Refinement r, open_renderer(std::move(options), callbacks));
    SR_CHECK(find_chains(r, callbacks));
    SR_CHECK(find_motion(r, callbacks));
    return r;
}

size_t Refinement::frames() const
{
    size_t count = 0;
    for (const RefineChain& c : chains)
        count += c.range.count();
    return count;
}

bool Refinement::was_stopped() const
{
    const auto before = read_json(options.output / "run.json");
    return before && before->is_object() && before->value("state", Json()) == "running";
}

bool Refinement::was_finished() const
{
    return finished_results(options.output, Json()).has_value();
}

Status write_frame_cameras(const Refinement& r)
{
    const RefinementOptions& o = r.options;
    if (!o.path)
        return {};
    const auto range_of = [&](const std::string& camera) {
        return std::ranges::find(r.chains, camera, [](const RefineChain& c) { return c.camera.name; })->range;
    };
    CameraPath refined{{}, o.path->sensors};
    std::map<std::string, uint32_t> counts;
    for (const CameraFrame& f : o.path->frames) {
        const uint32_t number = counts[f.camera]++;
        if (number >= range_of(f.camera).first && number <= range_of(f.camera).last)
            refined.frames.push_back(f);
    }
    TransformsFiles files;
    files.pictures = [&](const std::string& camera, uint32_t at) {
        const uint32_t number = range_of(camera).first + at;
        PictureNames names{
            fmt::format("frames/{}{}{:06}.{}", camera, camera.empty() ? "" : "/", number, o.format.extension()),
            {},
            {}};
        if (o.from_grid()) {
            const PictureNames drawn = rendered_pictures(camera, number);
            names.depth = "buffers/" + drawn.depth;
            names.label = "buffers/" + drawn.label;
        }
        return names;
    };
    return write_transforms(o.output / "transforms.json", refined, files);
}

Status Refinement::check_outputs(std::span<const Path> beside) const
{
    if (options.replace || was_stopped() || was_finished()) // the settings say whether that one is this one
        return {};
    const Path& out = options.output;
    std::vector<Path> files{out / "run.json", out / "frames", out / "latents", out / "transforms.json"};
    files.insert(files.end(), beside.begin(), beside.end());
    if (options.from_grid())
        files.push_back(out / "buffers");
    for (const Path& file : files)
        if (fs::exists(file))
            return fail(ErrorCode::usage, "{} exists; -y replaces it", quote_path(file));
    return {};
}

Result<Json> refinement_settings(const Refinement& r, const Device& device)
{
    const RefinementOptions& o = r.options;
    SR_TRY(const Json input, input_json(r));
    SR_TRY(const uint64_t model, r.model.hash());
    Json settings{{"command", "refine"},
                  {"version", kVersion},
                  {"device", device.name()},
                  {"driver", device.driver()},
                  {"input", input},
                  {"model", hash_text(model)},
                  {"precision", o.precision == DType::f32 ? "fp32" : "fp16"},
                  {"sampler", std::string(sampler_name(r.model.scheduler.sampler))},
                  {"steps", r.steps},
                  {"frame_noise", r.frame_noise == FrameNoise::warped ? "warped" : "fresh"},
                  {"seed", o.seed},
                  {"format", o.format.jpeg ? "jpeg" : "png"},
                  {"quality", o.format.jpeg ? o.format.quality : 0}};
    if (r.frame_history > 0) // not there without, so that runs of earlier versions go on
        settings["frame_history"] = r.frame_history;
    settings.update(r.model.video()
                        ? video_settings(r)
                        : Json{{"guidance_scale", r.asd.guidance_scale}, {"previous_noise", r.asd.previous_noise}});
    return settings;
}

Json describe(const Device& device, const Refinement& r, const MemoryPlan& plan)
{
    Json policies;
    for (MemoryPolicy policy : {MemoryPolicy::resident, MemoryPolicy::staged})
        policies[std::string(policy_name(policy))] = device.allocated_bytes() + plan.parts.peak(policy);
    Json figures{{"frames", r.frames()},
                 {"steps", r.steps},
                 {"policy", policy_name(plan.policy)},
                 {"planned_device_bytes", plan.bytes},
                 {"policies", policies},
                 {"unet_bytes", plan.parts.unet},
                 {"vae_bytes", plan.parts.vae},
                 {"device", device.name()}};
    if (r.model.video())
        figures.update(shape_json(r.shape));
    return figures;
}

} // namespace semrover
