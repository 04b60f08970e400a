// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/asd.h"

#include "engine/sampling/guidance.h"

namespace semrover {

namespace {

constexpr uint32_t kNoiseRows = 2; // rows of the step table before the plan's: first state, previous latent

} // namespace

struct AsdRenderer::FrameMemory : Denoiser::Memory {
    float guidance_scale;
    DeviceTensor previous;                    // latent of the frame before; begin_graph() puts noise on it
    DeviceTensor first_noise, previous_noise; // where noise comes from the host

    FrameMemory(const Unet& u, const SamplingPlan& p, uint32_t text_tokens, const LatentSize& size, const AsdOptions& o)
        : Memory(u, p, {size, 1, o.guidance_scale == 1.f ? 1u : 2u, kNoiseRows, text_tokens}, o.seed),
          guidance_scale(o.guidance_scale)
    {
        previous = latent("previous");
        if (o.noise) {
            first_noise = latent("first noise");
            previous_noise = latent("previous noise");
        }
    }
    // the first state, and the noise on the previous latent
    Graph begin_graph(const DeviceLimits& limits) const override
    {
        Graph g(limits);
        const StepTable s = tables.in(g);
        step_renoise(g, s, first_noise.valid() ? first_noise.in(g) : normals(g, s), x.in(g));
        step_advance(g, s.clock);
        step_renoise(g, s, previous_noise.valid() ? previous_noise.in(g) : normals(g, s), previous.in(g));
        step_advance(g, s.clock);
        return g;
    }
    Graph step_graph(const DeviceLimits& limits) const override
    {
        Graph g(limits);
        const StepTable s = tables.in(g);
        const Tensor state_x = x.in(g);
        const RendererFrame frame{previous.in(g), buffer.in(g), visible.in(g)};
        step_timestep(g, s, table_row.in(g));
        const Tensor in = renderer_input(g, s, state_x, frame, halves, unet.precision());
        const FeatureMap m =
            unet.forward(g, {in, halves, height, width}, tables.times.in(g), table_row.in(g), tables.context(g));
        const Tensor z = draws_noise(plan) ? normals(g, s) : frame.buffer;
        step_update(g, s, m.data, z, known.in(g), frame.buffer, state_x, x0.in(g), guidance_scale, float(plan.clip));
        step_advance(g, s.clock);
        return g;
    }
};

AsdRenderer::AsdRenderer(Device& device, const SamplingPlan& plan, AsdOptions options)
    : Denoiser(device, plan), options_(std::move(options))
{
}

Result<std::unique_ptr<AsdRenderer>> AsdRenderer::create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                         const Conditioning& conditioning, const LatentSize& size,
                                                         AsdOptions options, SharedArena arena)
{
    SR_CHECK(check_guidance(options.guidance_scale));
    if (!(options.previous_noise >= 0 && options.previous_noise <= 1000))
        return fail(ErrorCode::usage, "noise of {} on the previous frame is not in 0..1000", options.previous_noise);
    const UnetConfig& c = unet.config();
    if (c.in_channels != 3 * c.out_channels + 1)
        return fail(
            ErrorCode::bad_input,
            "the UNet takes {} channels, the renderer gives it {}: noisy, previous and buffer latent of {} each, "
            "and visibility",
            c.in_channels, 3 * c.out_channels + 1, c.out_channels);
    if (c.num_class_embeds)
        return fail(ErrorCode::bad_input, "the UNet wants one of {} class labels, which a renderer does not have",
                    c.num_class_embeds);
    std::unique_ptr<AsdRenderer> r(new AsdRenderer(device, plan, std::move(options)));
    auto memory = std::make_unique<FrameMemory>(unet, r->plan_, conditioning.tokens, size, r->options_);
    r->frame_ = memory.get();
    const StepRow before[] = {first_noise_row(r->plan_.init_noise_sigma, kFirstDraw),
                              more_noise_row(r->options_.previous_noise, kPreviousFrameDraw)};
    SR_CHECK(r->make(std::move(memory), before, conditioning, std::move(arena)));
    return r;
}

Result<PartBytes> AsdRenderer::planned_bytes(const DeviceLimits& limits, const Unet& unet, const SamplingPlan& plan,
                                             uint32_t text_tokens, const LatentSize& size, float guidance_scale)
{
    AsdOptions options;
    options.guidance_scale = guidance_scale;
    return FrameMemory(unet, plan, text_tokens, size, options).planned(limits);
}

Status AsdRenderer::upload(const DenoiserWindow& w) const
{
    const FrameMemory& m = *frame_;
    SR_ASSERT(w.known.empty() || w.known.size() == w.buffers.size(), "a frame before of {} values for {}",
              w.known.size(), w.buffers.size());
    SR_CHECK(m.previous.write_rows(device_, w.known));
    if (!m.first_noise.valid())
        return {};
    std::vector<float> initial(size_t(m.pixels) * m.channels), previous(initial.size());
    options_.noise(w.number, initial, previous);
    SR_CHECK(m.first_noise.write_rows(device_, initial));
    return m.previous_noise.write_rows(device_, previous);
}

// note: the first frame has nothing before it, not even noise
Status AsdRenderer::after_begin(const DenoiserWindow& w) const
{
    return w.known.empty() ? frame_->previous.clear(device_) : Status{};
}

} // namespace semrover
