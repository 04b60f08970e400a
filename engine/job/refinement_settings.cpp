// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/transforms.h"
#include "engine/job/frame_boxes.h"
#include "engine/job/input_hashes.h"
#include "engine/job/outputs.h"
#include "engine/job/refinement.h"
#include "engine/job/run_folder.h"
#include "engine/job/version.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

namespace {

// how wide splats are, and from which alpha they cover a pixel, unless the caller says so
void draw_as_trained(RefinementOptions& o, const RendererDefaults& d)
{
    o.draw.visible_alpha = o.draw.visible_alpha.value_or(d.visible_threshold);
    if (o.radius_given)
        return;
    o.draw.splats.auto_sigma = !d.splat_radius;
    o.draw.splats.sigma = d.splat_radius.value_or(o.draw.splats.sigma);
}

// the frames of a camera that are asked for
Result<FrameRange> range_of(const RefinementOptions& o, const BufferCamera& camera)
{
    const FrameRange r{o.first_frame.value_or(0), o.last_frame.value_or(camera.frames - 1)};
    if (r.first > r.last || r.last >= camera.frames)
        return fail(ErrorCode::usage, "`frames` {}:{} is not within 0:{}, the frames{}", r.first, r.last,
                    camera.frames - 1, camera.name.empty() ? "" : " of camera " + quote(camera.name));
    return r;
}

Result<std::vector<BufferCamera>> cameras_of(const RefinementOptions& o)
{
    if (o.from_grid() && !o.path)
        return fail(ErrorCode::usage, "`path` is required to refine straight from a grid");
    if (o.from_grid())
        return path_buffers(o.output / "buffers", *o.path, o.encoding.depth_unit());
    return open_buffers(o.input);
}

// the windows of a camera's frames and, going on from an earlier run, the latents of frames before those
Status find_windows(const Refinement& r, RefinedCamera& c)
{
    const WindowShape& shape = r.settings.shape;
    const bool goes_on = !r.options.from.empty() && c.first > 0;
    if (goes_on && r.model.video() && shape.overlap == 0)
        return fail(ErrorCode::usage, "`from` needs windows that overlap: they know nothing of the frames before them");
    const uint32_t most = r.model.video() ? std::min(c.first, shape.frames - 1) : 0;
    c.windows = frame_windows(c.range, goes_on ? most : 0, shape.frames, shape.overlap);
    const uint32_t together = c.windows.front().count;
    c.work = {c.work.size, true, true, true, together, std::min(shape.decode_frames, together)};
    if (!goes_on)
        return {};
    c.before = r.model.video() ? c.first - c.windows.front().first : 1;
    const Path latents = r.options.from / "latents" / c.name;
    for (uint32_t f = c.first - c.before; f < c.first; ++f) {
        SR_TRY(const std::vector<float> latent,
               read_latent(latents / fmt::format("{:06}.safetensors", f), c.size(), r.model.vae.latent_channels));
        c.latents_before.insert(c.latents_before.end(), latent.begin(), latent.end());
    }
    return {};
}

// the path that lies beside buffers, if it is theirs. bad_input: it cannot be read
Status take_path_beside(RefinementOptions& o, std::span<const BufferCamera> cameras, const JobCallbacks& callbacks)
{
    const Path file = o.input / "transforms.json";
    if (!is_file(file))
        return {};
    SR_TRY(const Json json, read_json(file));
    Result<CameraPath> path = parse_transforms(json, quote_path(file), {}, o.input);
    const Status fits = path ? check_against_path(cameras, *path) : tl::make_unexpected(path.error());
    if (fits)
        o.path = std::move(*path);
    else if (callbacks.warning)
        callbacks.warning(fmt::format("{} is not used: {}", quote_path(file), fits.error().message));
    return {};
}

// the cameras, their frames and what came before those
Status find_cameras(Refinement& r, const JobCallbacks& callbacks)
{
    const RefinementOptions& o = r.options;
    SR_TRY(const std::vector<BufferCamera> cameras, cameras_of(o));
    const bool path_given = o.path.has_value();
    if (path_given)
        SR_CHECK(check_against_path(cameras, *o.path));
    else
        SR_CHECK(take_path_beside(r.options, cameras, callbacks));
    for (const BufferCamera& camera : cameras) {
        if (o.size && !path_given && camera.size != *o.size)
            return fail(ErrorCode::bad_input, "the pictures in {} are {} x {} pixels, `width` and `height` say {} x {}",
                        quote_path(camera.folder), camera.size.width, camera.size.height, o.size->width,
                        o.size->height);
        RefinedCamera& c = r.cameras.emplace_back();
        c.buffers = camera;
        c.name = camera.name;
        c.work.size = {camera.size.width, camera.size.height, r.model.vae.downscale()};
        SR_TRY(c.range, range_of(o, camera));
        c.first = c.range.first;
        SR_CHECK(find_windows(r, c));
    }
    return {};
}

// the frame that an earlier run finished before the range: where it is there without a loss
Status find_picture_before(const Refinement& r, RefinedCamera& c)
{
    if (c.before == 0)
        return {};
    const Path picture = r.options.from / "frames" / c.name / fmt::format("{:06}.png", c.first - 1);
    if (!is_there(picture))
        return {};
    SR_TRY(ImageRgb8 image, read_png_rgb8(picture));
    if (image.width != c.size().image_width || image.height != c.size().image_height)
        return fail(ErrorCode::bad_input, "{}: {} x {} pixels, expected {} x {}", quote_path(picture), image.width,
                    image.height, c.size().image_width, c.size().image_height);
    c.picture_before = std::move(image.pixels);
    return {};
}

// Which surfaces frames share is known where the cameras are: without a path a model that asks for it does without, an
// option is refused
Status find_motion(Refinement& r, const JobCallbacks& callbacks)
{
    const RefinementOptions& o = r.options;
    RendererSettings& settings = r.settings;
    if (!settings.follows_surfaces())
        return {};
    if (!o.path) {
        if (o.renderer.frame_noise == FrameNoise::warped)
            return fail(ErrorCode::usage, "`frame_noise` warped needs the cameras of the buffers: `path`");
        if (o.renderer.frame_history.value_or(0) > 0)
            return fail(ErrorCode::usage, "`frame_history` needs the cameras of the buffers: `path`");
        settings.frame_noise = FrameNoise::fresh;
        settings.frame_history = 0;
        if (callbacks.warning)
            callbacks.warning("without `path` it is not known which surfaces frames share, as this model wants it: "
                              "frames will flicker more");
        return {};
    }
    for (RefinedCamera& c : r.cameras) {
        c.warped_noise = settings.frame_noise == FrameNoise::warped;
        c.history = settings.frame_history;
        std::ranges::copy_if(o.path->frames, std::back_inserter(c.cameras),
                             [&](const CameraFrame& f) { return f.camera == c.name; });
        c.model = c.cameras.front().intrinsics.model;
        if (c.history > 0)
            SR_CHECK(find_picture_before(r, c));
    }
    return {};
}

Result<Json> camera_json(const Refinement& r, const RefinedCamera& c)
{
    Json camera{{"name", c.name},
                {"width", c.size().image_width},
                {"height", c.size().image_height},
                {"first_frame", c.range.first},
                {"last_frame", c.range.last}};
    if (c.before > 0) {
        Hash hash;
        hash.add(std::as_bytes(std::span(c.latents_before)));
        hash.add(std::as_bytes(std::span(c.picture_before)));
        camera["before"] = hash_text(hash.value());
    }
    if (r.options.from_grid())
        return camera;
    const uint32_t first = std::min(c.range.first, c.windows.front().first); // the first that a window sees
    SR_TRY(const uint64_t buffers, hash_pictures(c.buffers, {"color", "visible"}, first, c.range.last));
    camera["buffers"] = hash_text(buffers);
    if (r.settings.follows_surfaces()) {
        SR_TRY(const uint64_t depth, hash_pictures(c.buffers, {"depth"}, 0, c.range.last));
        camera["depth"] = hash_text(depth);
        if (c.buffers.depth_unit != kMillimetre) // not there with it, so that runs of earlier versions go on
            camera["depth_unit"] = c.buffers.depth_unit;
    }
    return camera;
}

// what the buffers come from
Result<Json> input_json(const Refinement& r)
{
    const RefinementOptions& o = r.options;
    Json cameras = Json::array();
    for (const RefinedCamera& c : r.cameras) {
        SR_TRY(Json camera, camera_json(r, c));
        cameras.push_back(std::move(camera));
    }
    Json input{{"cameras", cameras}};
    if (o.from_grid() || r.settings.follows_surfaces())
        input["path"] = hash_text(hash_cameras(*o.path)); // as read, whatever files and options it came from
    if (!o.from_grid())
        return input;
    SR_TRY(const uint64_t grid, hash_file(o.input));
    input["grid"] = hash_text(grid);
    input["drive"] = drawing_json(o.draw);
    return input;
}

Json shape_json(const WindowShape& s)
{
    return {{"window_frames", s.frames}, {"window_overlap", s.overlap}, {"decode_frames", s.decode_frames}};
}

// what of a renderer of videos decides its frames
Json video_settings(const Refinement& r)
{
    Json settings = shape_json(r.settings.shape);
    settings["guidance_scale"] = r.settings.vsd.last_guidance;
    settings["first_guidance_scale"] = r.settings.vsd.first_guidance;
    settings["frame_correlation"] = r.settings.vsd.correlation;
    settings["added_time_ids"] = r.model.defaults.video.added_numbers;
    return settings;
}

} // namespace

Result<Refinement> resolve_refinement(RefinementOptions options, const JobCallbacks& callbacks)
{
    Refinement r;
    r.options = std::move(options);
    if (r.options.encoding.depth != DepthFormat::mm && !r.options.from_grid())
        return fail(ErrorCode::usage, "`depth` has a meaning for a grid, whose buffers are drawn");
    SR_TRY(r.model, RendererModel::open(r.options.model, r.options.sampler));
    for (const std::string& warning : r.model.warnings)
        if (callbacks.warning)
            callbacks.warning(warning);
    SR_TRY(r.settings, settle_renderer(r.model, r.options.renderer));
    draw_as_trained(r.options, r.model.defaults);
    ShardsOrNone from; // what is read of an earlier run is read here
    if (!r.options.from.empty()) {
        SR_TRY(from, open_if_shards(r.options.from));
    }
    SR_CHECK(find_cameras(r, callbacks));
    SR_CHECK(find_motion(r, callbacks));
    return r;
}

size_t Refinement::frames() const
{
    size_t count = 0;
    for (const RefinedCamera& c : cameras)
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
        return std::ranges::find(r.cameras, camera, &RefinedCamera::name)->range;
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
            fmt::format("frames/{}{}{:06}.{}", camera, camera.empty() ? "" : "/", number, o.encoding.color_extension()),
            {},
            {}};
        if (o.from_grid()) {
            const PictureNames drawn = rendered_pictures(camera, number, o.buffer_encoding());
            names.depth = "buffers/" + drawn.depth;
            names.label = "buffers/" + drawn.label;
        }
        return names;
    };
    files.depth_unit = o.encoding.depth_unit();
    return write_transforms(o.output / "transforms.json", refined, files);
}

Status write_frame_record(const Refinement& r, const JobCallbacks& callbacks)
{
    const RefinementOptions& o = r.options;
    const bool beside = !o.from_grid() && is_file(o.input / kDriveRecordFiles[0]);
    if (!beside && o.path)
        return write_record_of(*o.path, o.encoding.depth_unit(), o.output, callbacks);
    if (!beside)
        return {};
    SR_CHECK(read_drive_record(o.input)); // what is wrong with it is said before anything is refined
    std::vector<const char*> names(std::begin(kDriveRecordFiles), std::end(kDriveRecordFiles));
    names.insert(names.end(), {kBoxesName, kObjectsName});
    for (const char* name : names) {
        if (!is_file(o.input / name))
            continue;
        SR_TRY(const MappedFile file, MappedFile::open(o.input / name));
        SR_CHECK(write_file_atomically(o.output / name, file.bytes()));
    }
    return {};
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
        SR_CHECK(refuse_existing(file, false));
    return {};
}

Result<Json> refinement_settings(const Refinement& r, const Device& device)
{
    const RefinementOptions& o = r.options;
    SR_TRY(const Json input, input_json(r));
    SR_TRY(const uint64_t model, r.model.hash());
    Json settings{{"command", "refine"},
                  {"version", kVersion},
                  {"input", input},
                  {"model", hash_text(model)},
                  {"precision", o.precision == DType::f32 ? "fp32" : "fp16"},
                  {"sampler", std::string(sampler_name(r.model.scheduler.sampler))},
                  {"steps", r.settings.steps},
                  {"frame_noise", r.settings.frame_noise == FrameNoise::warped ? "warped" : "fresh"},
                  {"seed", o.renderer.seed},
                  {"format", o.encoding.jpeg ? "jpeg" : "png"},
                  {"quality", o.encoding.jpeg ? o.encoding.quality : 0}};
    if (r.settings.frame_history > 0) // not there where it says nothing
        settings["frame_history"] = r.settings.frame_history;
    settings.update(encoding_json(o.encoding)); // likewise
    settings.update(device_key(device));
    settings.update(r.model.video() ? video_settings(r)
                                    : Json{{"guidance_scale", r.settings.asd.guidance_scale},
                                           {"previous_noise", r.settings.asd.previous_noise}});
    return settings;
}

Json describe(const Device& device, const Refinement& r, const MemoryPlan& plan)
{
    Json policies;
    for (MemoryPolicy policy : {MemoryPolicy::resident, MemoryPolicy::staged})
        policies[std::string(policy_name(policy))] = device.allocated_bytes() + plan.parts.peak(policy);
    Json figures{{"frames", r.frames()},
                 {"steps", r.settings.steps},
                 {"policy", policy_name(plan.policy)},
                 {"planned_device_bytes", plan.bytes},
                 {"policies", policies},
                 {"unet_bytes", plan.parts.unet},
                 {"vae_bytes", plan.parts.vae},
                 {"device", device.name()}};
    if (r.model.video())
        figures.update(shape_json(r.settings.shape));
    return figures;
}

} // namespace semrover
