// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// chains: frames of splat buffers, one after the other
#include "engine/capi/exchange.h"

using namespace semrover;
using namespace semrover::capi;

namespace {

// calls f with the chain; an error is its context's
template <typename F>
sr_status with_chain(sr_chain* chain, const char* name, F f) noexcept
{
    return guarded(chain ? chain->context : nullptr, [&]() -> Status {
        if (!chain)
            return fail(ErrorCode::usage, "{}: chain is NULL", name);
        return f(*chain->chain);
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
        return fail(ErrorCode::usage, "sr_chain_desc: noise is {}, which is none of SR_NOISE_..", noise);
    }
}

Result<RefinementOptions> options_of(const sr_chain_desc& d, const Model& model)
{
    if (d.steps > 1'000'000)
        return fail(ErrorCode::usage, "sr_chain_desc: {} steps", d.steps);
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_chain_desc: reserved is not 0");
    RefinementOptions o;
    o.model = model.path();
    if (d.steps)
        o.steps = int(d.steps);
    o.seed = d.seed;
    o.precision = model.precision();
    SR_TRY(o.frame_noise, noise_of(d.noise));
    if (d.noise == SR_NOISE_FRESH)
        o.frame_history = 0; // neither needs to know what frames share
    return o;
}

Result<std::unique_ptr<sr_chain>> make_chain(sr_context& context, const sr_chain_desc& d)
{
    auto chain = std::make_unique<sr_chain>();
    chain->context = &context;
    chain->size = {d.width, d.height};
    SR_CHECK(check_size(chain->size, "sr_chain_desc"));
    SR_TRY(chain->model, model_of(context, d.model, "sr_chain_desc"));
    const auto& networks = chain->model->renderer();
    if (!networks)
        return fail(ErrorCode::usage, "sr_chain_desc: the model has no renderer");
    SR_TRY(RefinementOptions options, options_of(d, *chain->model));
    JobCallbacks callbacks;
    if (d.message)
        callbacks.warning = [&d](std::string_view line) { d.message(d.user, std::string(line).c_str()); };
    SR_TRY(Refinement renderer, open_renderer(std::move(options), callbacks));
    const std::string camera = d.camera ? d.camera : "";
    if (!camera.empty() && !is_camera_name(camera))
        return fail(ErrorCode::usage, "sr_chain_desc: a camera's name has 1 to 64 of A-Z a-z 0-9 . _ -");
    SR_TRY(chain->chain, FrameChain::create(*context.device, networks, std::move(renderer), chain->size, camera));
    return chain;
}

// what splats of a world look like, into the chain's memory; depth, where it is wanted
Result<ImageGray16> draw_world(sr_chain& chain, sr_world& world, const CameraFrame& camera)
{
    FrameChain& c = *chain.chain;
    if (world.context != chain.context)
        return fail(ErrorCode::usage, "sr_frame_desc: the world belongs to another context");
    SR_TRY(const SplatPool* splats, splats_of(world, "sr_frame_desc"));
    Device& device = *chain.context->device;
    SR_TRY(Rasterizer * rasterizer,
           world.pixels.of(device, splats->scene(), chain.size, c.renderer().draw.rasterizer()));
    const SplatCamera seen_by = splat_camera(camera.intrinsics, camera.pose);
    SR_CHECK(rasterizer->draw({&seen_by, 1}).map([](uint32_t) {}));
    const SplatPixelSlots pixels = rasterizer->pixels(0);
    SR_CHECK(c.fill(pixels.seen));
    ImageGray16 depth{chain.size.width, chain.size.height, {}};
    if (!c.follows_surfaces())
        return depth;
    FramePixels read{chain.size.width, chain.size.height, {}, {}, {}};
    SR_TRY(read.ranges, pixels.ranges.read<uint32_t>(device));
    depth.pixels = depth_pixels(read);
    return depth;
}

// what the host gives
Result<ImageGray16> take_buffers(sr_chain& chain, const sr_frame_desc& d)
{
    FrameChain& c = *chain.chain;
    const uint64_t pixels = uint64_t(chain.size.width) * chain.size.height;
    SR_CHECK(take_in(*chain.context, d.seen, c.seen(), pixels * 4, "sr_frame_desc.seen"));
    ImageGray16 depth{chain.size.width, chain.size.height, {}};
    if (!c.follows_surfaces())
        return depth;
    depth.pixels.resize(pixels);
    if (d.depth.memory && !d.depth.buffer) {
        std::memcpy(depth.pixels.data(), d.depth.memory, pixels * 2);
        return depth;
    }
    SR_CHECK(take_in(*chain.context, d.depth, c.depths(), pixels * 2, "sr_frame_desc.depth"));
    SR_CHECK(chain.context->device->read(c.depths().slice(), std::as_writable_bytes(std::span(depth.pixels))));
    return depth;
}

Status begin_frame(sr_chain& chain, const sr_frame_desc& d)
{
    FrameChain& c = *chain.chain;
    if (d.reserved)
        return fail(ErrorCode::usage, "sr_frame_desc: reserved is not 0");
    if (c.busy())
        return fail(ErrorCode::usage, "sr_chain_begin: a frame is at work; finish or cancel it");
    if (d.world && (d.seen.memory || d.seen.buffer || d.depth.memory || d.depth.buffer))
        return fail(ErrorCode::usage, "sr_frame_desc: one of world and seen must be given");
    const CameraFrame camera = camera_frame({d.fx, d.fy, d.cx, d.cy}, d.world_to_camera, chain.size);
    if (d.world || c.follows_surfaces())
        SR_CHECK(check_camera(camera, "sr_frame_desc"));
    SR_TRY(const ImageGray16 depth, d.world ? draw_world(chain, *d.world, camera) : take_buffers(chain, d));
    return c.begin(camera, depth);
}

sr_chain_info info_of(const FrameChain& chain)
{
    const Refinement& r = chain.renderer();
    sr_chain_info info{};
    info.steps = uint32_t(r.steps);
    info.frames = chain.frames();
    info.noise = chain.follows_surfaces() ? SR_NOISE_ON_SURFACES : SR_NOISE_FRESH;
    info.busy = chain.busy();
    info.resident = chain.memory().policy == MemoryPolicy::resident;
    info.device_bytes = chain.memory().bytes;
    info.visible_alpha = *r.draw.visible_alpha;
    info.splat_radius = r.draw.surfels.auto_sigma ? 0 : r.draw.surfels.sigma;
    return info;
}

} // namespace

extern "C" {

sr_status sr_chain_create(sr_context* context, const sr_chain_desc* desc, sr_chain** chain)
{
    return guarded(context, [&]() -> Status {
        if (!context || !chain)
            return fail(ErrorCode::usage, "sr_chain_create: NULL");
        *chain = nullptr;
        SR_TRY(const sr_chain_desc known, read_struct(desc, "sr_chain_desc"));
        SR_TRY(auto made, make_chain(*context, known));
        *chain = made.release();
        return {};
    });
}

void sr_chain_destroy(sr_chain* chain)
{
    delete chain;
}

sr_status sr_chain_begin(sr_chain* chain, const sr_frame_desc* frame)
{
    return with_chain(chain, "sr_chain_begin", [&](FrameChain&) -> Status {
        SR_TRY(const sr_frame_desc known, read_struct(frame, "sr_frame_desc"));
        return begin_frame(*chain, known);
    });
}

sr_status sr_chain_step(sr_chain* chain, uint64_t budget_us, uint32_t* done)
{
    return with_chain(chain, "sr_chain_step", [&](FrameChain& c) -> Status {
        if (!c.busy())
            return fail(ErrorCode::usage, "sr_chain_step: no frame has begun");
        SR_TRY(const bool all, c.step(timed_budget(budget_us)));
        if (done)
            *done = all;
        return {};
    });
}

sr_status sr_chain_take(sr_chain* chain, const sr_target* target)
{
    return with_chain(chain, "sr_chain_take", [&](FrameChain& c) -> Status {
        if (!target)
            return fail(ErrorCode::usage, "sr_chain_take: target is NULL");
        if (!c.frames())
            return fail(ErrorCode::usage, "sr_chain_take: no frame is finished");
        return hand_over(*chain->context, c.texels(), chain->size, *target);
    });
}

sr_status sr_chain_cancel(sr_chain* chain)
{
    return with_chain(chain, "sr_chain_cancel", [](FrameChain& c) { return c.cancel(); });
}

sr_status sr_chain_restart(sr_chain* chain)
{
    return with_chain(chain, "sr_chain_restart", [](FrameChain& c) -> Status {
        if (c.busy())
            return fail(ErrorCode::usage, "sr_chain_restart: a frame is at work; finish or cancel it");
        c.restart();
        return {};
    });
}

sr_status sr_chain_get_info(sr_chain* chain, sr_chain_info* info)
{
    return with_chain(chain, "sr_chain_get_info",
                      [&](FrameChain& c) { return write_result(info_of(c), info, "sr_chain_get_info"); });
}

} // extern "C"

static_assert(sizeof(sr_source) == 24 && sizeof(sr_frame_desc) == 200);
static_assert(sizeof(sr_chain_desc) == 72 && sizeof(sr_chain_info) == 48);
