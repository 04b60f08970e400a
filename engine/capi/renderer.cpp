// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// renderers: frames of splat buffers of one camera, one after the other
#include "engine/capi/draws.h"
#include "engine/deferred/frame_images.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// calls f with the camera's renderer; an error is its context's
template <Use use = kWork, typename F>
sr_status with_renderer(sr_renderer* renderer, const char* name, F f) noexcept
{
    return guarded<use>(renderer ? renderer->context : nullptr, [&]() -> Status {
        if (!renderer)
            return fail(ErrorCode::usage, "{}: renderer is NULL", name);
        return f(*renderer->camera);
    });
}

Result<std::optional<FrameNoise>> noise_of(uint32_t noise)
{
    switch (noise) {
    case SR_NOISE_OF_MODEL:
        return std::nullopt;
    case SR_NOISE_FRESH:
        return FrameNoise::fresh;
    case SR_NOISE_ON_SURFACES:
        return FrameNoise::warped;
    default:
        return fail(ErrorCode::usage, "sr_renderer_desc: noise is {}, which is none of SR_NOISE_..", noise);
    }
}

Result<RendererOptions> options_of(const sr_renderer_desc& d)
{
    if (d.steps > 1'000'000)
        return fail(ErrorCode::usage, "sr_renderer_desc: {} steps", d.steps);
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_renderer_desc: reserved is not 0");
    RendererOptions o;
    if (d.steps)
        o.steps = int(d.steps);
    o.seed = d.seed;
    SR_TRY(o.frame_noise, noise_of(d.noise));
    if (d.noise == SR_NOISE_FRESH)
        o.frame_history = 0; // neither needs to know what frames share
    return o;
}

Result<std::unique_ptr<sr_renderer>> make_renderer(sr_context& context, const sr_renderer_desc& d)
{
    auto renderer = std::make_unique<sr_renderer>();
    renderer->context = &context;
    renderer->size = {d.width, d.height};
    SR_CHECK(check_size(renderer->size, "sr_renderer_desc"));
    SR_TRY(renderer->model, model_of(context, d.model, "sr_renderer_desc"));
    const std::shared_ptr<LoadedNetworks>& networks = renderer->model->renderer();
    if (!networks)
        return fail(ErrorCode::usage, "sr_renderer_desc: the model has no renderer");
    SR_TRY(const RendererOptions options, options_of(d));
    for (const std::string& warning : networks->model().warnings)
        if (d.message)
            d.message(d.user, warning.c_str());
    SR_TRY(RendererSettings settings, settle_renderer(networks->model(), options));
    const std::string camera = d.camera ? d.camera : "";
    if (!camera.empty() && !is_camera_name(camera))
        return fail(ErrorCode::usage, "sr_renderer_desc: a camera's name has 1 to 64 of A-Z a-z 0-9 . _ -");
    SR_TRY(renderer->camera,
           CameraRenderer::create(*context.device, networks, std::move(settings), renderer->size, camera));
    return renderer;
}

// what splats of a world look like, into the renderer's memory; depth, where it is wanted
Result<DepthPicture> draw_world(sr_renderer& renderer, sr_world& world, const CameraFrame& camera)
{
    CameraRenderer& r = *renderer.camera;
    if (world.context != renderer.context)
        return fail(ErrorCode::usage, "sr_frame_desc: the world belongs to another context");
    SR_TRY(const SplatPool* splats, splats_of(world, "sr_frame_desc"));
    if (!world.updated_by_application)
        SR_CHECK(show_updates(world, true));
    Device& device = *renderer.context->device;
    RasterizerOptions options;
    options.visible_alpha = r.model().defaults.visible_threshold;
    options.pixels_over = std::array<uint8_t, 3>{};
    SR_TRY(Rasterizer * rasterizer, world.pixels.of(device, *splats, renderer.size, with_actors(world, options)));
    const SplatCamera seen_by = splat_camera(camera.intrinsics, camera.pose);
    SR_CHECK(rasterizer->draw({&seen_by, 1}, world.actors.seen_by({&camera, 1})).map([](uint32_t) {}));
    const SplatPixelSlots pixels = rasterizer->pixels(0);
    SR_CHECK(r.fill(pixels.seen));
    DepthPicture depth{renderer.size.width, renderer.size.height, {}};
    if (r.settings().follows_surfaces()) {
        SR_TRY(depth.pixels, pixels.depths.read<uint32_t>(device));
    }
    return depth;
}

Status check_frame_target(const sr_target& target)
{
    const bool known =
        !target.format || target.format == VK_FORMAT_R8G8B8A8_UNORM || target.format == VK_FORMAT_R8G8B8A8_SRGB;
    if (!known || target.reserved)
        return fail(ErrorCode::usage, "sr_target: a frame cannot have format {}, or reserved is not 0", target.format);
    return {};
}

// what the application gives
Result<DepthPicture> take_buffers(sr_renderer& renderer, const sr_frame_desc& d)
{
    CameraRenderer& r = *renderer.camera;
    const uint64_t pixels = uint64_t(renderer.size.width) * renderer.size.height;
    SR_CHECK(take_in(*renderer.context, d.seen, r.seen(), pixels * 4, "sr_frame_desc.seen"));
    ImageGray16 depth{renderer.size.width, renderer.size.height, {}};
    if (!r.settings().follows_surfaces())
        return depth_of_gray(depth, kMillimetre);
    depth.pixels.resize(pixels);
    if (d.depth.memory && !d.depth.buffer) {
        std::memcpy(depth.pixels.data(), d.depth.memory, pixels * 2);
        return depth_of_gray(depth, kMillimetre);
    }
    SR_CHECK(take_in(*renderer.context, d.depth, r.depths(), pixels * 2, "sr_frame_desc.depth"));
    SR_CHECK(renderer.context->device->read(r.depths().slice(), std::as_writable_bytes(std::span(depth.pixels))));
    return depth_of_gray(depth, kMillimetre);
}

Status begin_frame(sr_renderer& renderer, const sr_frame_desc& d)
{
    CameraRenderer& r = *renderer.camera;
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_frame_desc: reserved is not 0");
    if (r.busy())
        return fail(ErrorCode::usage, "sr_renderer_begin: a frame is at work; finish or cancel it");
    if (d.world && (d.seen.memory || d.seen.buffer || d.depth.memory || d.depth.buffer))
        return fail(ErrorCode::usage, "sr_frame_desc: one of world and seen must be given");
    const CameraFrame camera = camera_frame({d.fx, d.fy, d.cx, d.cy}, d.world_to_camera, renderer.size, d.time);
    if (d.world || r.settings().follows_surfaces())
        SR_CHECK(check_camera(camera, "sr_frame_desc"));
    SR_TRY(DepthPicture depth, d.world ? draw_world(renderer, *d.world, camera) : take_buffers(renderer, d));
    return r.begin({camera, std::move(depth)});
}

sr_renderer_info info_of(const CameraRenderer& r)
{
    const RendererDefaults& trained = r.model().defaults;
    sr_renderer_info info{};
    info.steps = uint32_t(r.settings().steps);
    info.frames = r.frames();
    info.noise = r.settings().follows_surfaces() ? SR_NOISE_ON_SURFACES : SR_NOISE_FRESH;
    info.busy = r.busy();
    info.resident = r.memory().policy == MemoryPolicy::resident;
    info.device_bytes = r.memory().bytes;
    info.visible_alpha = trained.visible_threshold;
    info.splat_radius = trained.splat_radius.value_or(0);
    return info;
}

} // namespace

extern "C" {

sr_status sr_renderer_create(sr_context* context, const sr_renderer_desc* desc, sr_renderer** renderer)
{
    return guarded<kWork>(context, [&]() -> Status {
        if (!context || !renderer)
            return fail(ErrorCode::usage, "sr_renderer_create: NULL");
        *renderer = nullptr;
        SR_TRY(const sr_renderer_desc known, read_struct(desc, "sr_renderer_desc"));
        SR_TRY(auto made, make_renderer(*context, known));
        *renderer = made.release();
        return {};
    });
}

void sr_renderer_destroy(sr_renderer* renderer)
{
    destroy(renderer);
}

sr_status sr_renderer_begin(sr_renderer* renderer, const sr_frame_desc* frame)
{
    return with_renderer<kAlone>(renderer, "sr_renderer_begin", [&](CameraRenderer&) -> Status {
        SR_TRY(const sr_frame_desc known, read_struct(frame, "sr_frame_desc"));
        return begin_frame(*renderer, known);
    });
}

sr_status sr_renderer_step(sr_renderer* renderer, uint64_t budget_us, uint32_t* done)
{
    return with_renderer(renderer, "sr_renderer_step", [&](CameraRenderer& r) -> Status {
        if (!r.busy())
            return fail(ErrorCode::usage, "sr_renderer_step: no frame has begun");
        SR_TRY(const bool all, r.step(timed_budget(budget_us)));
        if (done)
            *done = all;
        return {};
    });
}

sr_status sr_renderer_take(sr_renderer* renderer, const sr_target* target)
{
    return with_renderer<kAlone>(renderer, "sr_renderer_take", [&](CameraRenderer& r) -> Status {
        if (!target)
            return fail(ErrorCode::usage, "sr_renderer_take: target is NULL");
        if (!r.frames())
            return fail(ErrorCode::usage, "sr_renderer_take: no frame is finished");
        SR_CHECK(check_frame_target(*target));
        SR_CHECK(renderer->context->device->wait(renderer->context->device->last_ticket()));
        const WantedPicture frame{r.texels().slice(), target, renderer->size};
        return hand_over(*renderer->context, {&frame, 1});
    });
}

sr_status sr_renderer_cancel(sr_renderer* renderer)
{
    return with_renderer(renderer, "sr_renderer_cancel", [](CameraRenderer& r) { return r.cancel(); });
}

sr_status sr_renderer_restart(sr_renderer* renderer)
{
    return with_renderer(renderer, "sr_renderer_restart", [](CameraRenderer& r) -> Status {
        if (r.busy())
            return fail(ErrorCode::usage, "sr_renderer_restart: a frame is at work; finish or cancel it");
        r.restart();
        return {};
    });
}

sr_status sr_renderer_get_info(sr_renderer* renderer, sr_renderer_info* info)
{
    return with_renderer(renderer, "sr_renderer_get_info",
                         [&](CameraRenderer& r) { return write_result(info_of(r), info, "sr_renderer_get_info"); });
}

} // extern "C"

static_assert(sizeof(sr_source) == 24 && sizeof(sr_frame_desc) == 208);
static_assert(sizeof(sr_renderer_desc) == 72 && sizeof(sr_renderer_info) == 48);
