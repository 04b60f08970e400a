// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/asd.h"

#include "engine/sampling/guidance.h"
#include "kernels/picture.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kNoiseRows = 2; // rows of the step table before the plan's: first state, previous latent

uint32_t halves_of(float guidance_scale)
{
    return guidance_scale == 1.f ? 1 : 2;
}

} // namespace

// what stays on the device from step to step, and the graphs over it
struct AsdRenderer::Memory {
    const Unet& unet;
    const SamplingPlan& plan;
    uint32_t width, height, pixels, rows, channels, halves;
    State state;
    DenoiserTables tables;
    Slot table_row, cells, known, x0;
    AsdSlots ends;                    // latent: the state x
    Slot first_noise, previous_noise; // where noise comes from the host

    Memory(const Unet& u, const SamplingPlan& p, uint32_t text_tokens, const LatentSize& size, float guidance_scale,
           bool fed)
        : unet(u), plan(p), width(size.width()), height(size.height()), pixels(size.pixels()),
          rows(round_up(pixels, kImageRowPadding)), channels(u.config().out_channels),
          halves(halves_of(guidance_scale)), tables(state, u, p, kNoiseRows, text_tokens)
    {
        table_row = state.slot(halves, 1, DType::u32, "table_row", 1);
        cells = state.slot(rows, 4, DType::i32, "cells", 4);
        known = state.slot(rows, 1, DType::u32, "known", 1);
        ends.latent = latent("x");
        x0 = latent("x0");
        ends.previous = latent("previous");
        ends.buffer = latent("buffer");
        ends.visible = state.slot(rows, 1, DType::f32, "visible", 1);
        ends.bad = state.slot(1, 1, DType::u32, "first number that is none", 1);
        if (fed) {
            first_noise = latent("first noise");
            previous_noise = latent("previous noise");
        }
    }
    Slot latent(const char* name) { return state.slot(rows, channels, DType::f32, name); }
    Tensor noise(Graph& g, StepTable table_of_steps, uint64_t seed) const
    {
        return step_noise(g, table_of_steps, cells.in(g), known.in(g), channels, seed);
    }

    // once: what depends on the timestep or the text only
    Graph tables_graph() const
    {
        Graph g;
        tables.add(g, unet);
        return g;
    }
    // once a frame: the first state, and the noise on the previous latent
    Graph begin_graph(uint64_t seed) const
    {
        Graph g;
        const StepTable s = tables.in(g);
        step_renoise(g, s, first_noise.valid() ? first_noise.in(g) : noise(g, s, seed), ends.latent.in(g));
        step_advance(g, s.clock);
        step_renoise(g, s, previous_noise.valid() ? previous_noise.in(g) : noise(g, s, seed), ends.previous.in(g));
        step_advance(g, s.clock);
        return g;
    }
    Graph step_graph(float guidance_scale, uint64_t seed) const
    {
        Graph g;
        const StepTable s = tables.in(g);
        const Tensor x = ends.latent.in(g);
        const RendererFrame frame{ends.previous.in(g), ends.buffer.in(g), ends.visible.in(g)};
        step_timestep(g, s, table_row.in(g));
        const Tensor in = renderer_input(g, s, x, frame, halves, unet.precision());
        const FeatureMap m =
            unet.forward(g, {in, halves, height, width}, tables.times.in(g), table_row.in(g), tables.context(g));
        const Tensor z = draws_noise(plan) ? noise(g, s, seed) : frame.buffer;
        step_update(g, s, m.data, z, known.in(g), frame.buffer, x, x0.in(g), guidance_scale, float(plan.clip));
        step_advance(g, s.clock);
        return g;
    }
    Graph check_graph() const
    {
        Graph g;
        g.keep(first_non_finite(g, ends.latent.in(g), {width, height, width, height}), ends.bad);
        return g;
    }
};

AsdRenderer::AsdRenderer(Device& device, const SamplingPlan& plan, AsdOptions options)
    : device_(device), plan_(plan), options_(std::move(options))
{
}
AsdRenderer::~AsdRenderer() = default;

Result<std::unique_ptr<AsdRenderer>> AsdRenderer::create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                         const Conditioning& text, const LatentSize& size,
                                                         AsdOptions options)
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
    r->memory_ = std::make_unique<Memory>(unet, r->plan_, text.tokens, size, r->options_.guidance_scale,
                                          bool(r->options_.noise));
    SR_CHECK(r->memory_->state.allocate(device, "renderer state"));
    SR_CHECK(r->make_tables(text));
    return r;
}

Result<AsdRenderer::Bytes> AsdRenderer::planned_bytes(const DeviceLimits& limits, const Unet& unet,
                                                      const SamplingPlan& plan, uint32_t text_tokens,
                                                      const LatentSize& size, float guidance_scale)
{
    const Memory m(unet, plan, text_tokens, size, guidance_scale, false);
    SR_TRY(const Plan tables, make_plan(m.tables_graph().desc(), limits));
    SR_TRY(const Plan begin, make_plan(m.begin_graph(0).desc(), limits));
    SR_TRY(const Plan step, make_plan(m.step_graph(guidance_scale, 0).desc(), limits));
    SR_TRY(const Plan check, make_plan(m.check_graph().desc(), limits));
    return Bytes{m.state.planned_bytes(limits),
                 std::max(tables.arena_bytes(), begin.arena_bytes() + step.arena_bytes() + check.arena_bytes())};
}

Status AsdRenderer::make_tables(const Conditioning& text)
{
    const Memory& m = *memory_;
    const StepRow before[] = {first_noise_row(plan_.init_noise_sigma, kFirstDraw),
                              more_noise_row(options_.previous_noise, kPreviousFrameDraw)};
    SR_CHECK(m.tables.write(device_, plan_, before, {text}));
    SR_CHECK(m.known.clear(device_));
    SR_TRY(const auto tables, Program::create(device_, m.tables_graph()));
    return tables->run();
}

Status AsdRenderer::make_programs()
{
    if (step_)
        return {};
    SR_TRY(begin_, Program::create(device_, memory_->begin_graph(options_.seed)));
    SR_TRY(step_, Program::create(device_, memory_->step_graph(options_.guidance_scale, options_.seed)));
    SR_TRY(check_, Program::create(device_, memory_->check_graph()));
    replay_.emplace(device_, plan_.rows.size(), [this](size_t) -> Result<Program*> { return step_.get(); });
    return {};
}

void AsdRenderer::rest()
{
    replay_.reset();
    begin_.reset();
    step_.reset();
    check_.reset();
}

Status AsdRenderer::upload(const AsdFrame& frame)
{
    const Memory& m = *memory_;
    const size_t values = size_t(m.pixels) * m.channels;
    SR_ASSERT(frame.buffer.size() == values && frame.visible.size() == m.pixels &&
                  (frame.previous.empty() || frame.previous.size() == values),
              "a frame of {} values for {} pixels", frame.buffer.size(), m.pixels);
    SR_CHECK(m.ends.visible.write_rows(device_, frame.visible));
    SR_CHECK(m.ends.buffer.write_rows(device_, frame.buffer));
    return m.ends.previous.write_rows(device_, frame.previous);
}

// where noise comes from
Status AsdRenderer::upload_keys(const AsdStart& start)
{
    const Memory& m = *memory_;
    SR_ASSERT(start.keys.empty() || start.keys.size() == m.pixels, "{} keys for {} pixels", start.keys.size(),
              m.pixels);
    std::vector<int32_t> cells(m.rows * 4ull, 0);
    for (uint32_t r = 0; r < m.rows; ++r) {
        const NoiseKey key = r < start.keys.size() ? start.keys[r] : NoiseKey{r, start.number};
        cells[4 * r] = int32_t(key.pixel);
        cells[4 * r + 1] = int32_t(key.frame);
        cells[4 * r + 2] = int32_t(start.chain);
    }
    SR_CHECK(m.cells.write(device_, cells));
    if (!m.first_noise.valid())
        return {};
    std::vector<float> initial(size_t(m.pixels) * m.channels), previous(initial.size());
    options_.noise(start.number, initial, previous);
    SR_CHECK(m.first_noise.write_rows(device_, initial));
    return m.previous_noise.write_rows(device_, previous);
}

Status AsdRenderer::begin(const AsdFrame& frame)
{
    SR_CHECK(upload(frame));
    return begin(AsdStart{frame.number, frame.chain, frame.previous.empty(), frame.keys});
}

Status AsdRenderer::begin(const AsdStart& start)
{
    SR_CHECK(make_programs());
    SR_CHECK(replay_->begin({memory_->tables.clock, memory_->ends.latent, memory_->x0}));
    SR_CHECK(upload_keys(start));
    SR_CHECK(begin_->run());
    // note: the first frame has nothing before it, not even noise
    return start.first ? memory_->ends.previous.clear(device_) : Status{};
}

const AsdSlots& AsdRenderer::slots() const
{
    return memory_->ends;
}

Result<bool> AsdRenderer::step(size_t submits)
{
    SR_ASSERT(replay_, "a step of a renderer that has not begun a frame");
    return replay_->step(submits);
}

Status AsdRenderer::cancel()
{
    return replay_ ? replay_->cancel() : Status{};
}

Status AsdRenderer::end()
{
    SR_ASSERT(replay_, "a frame is finished that has not begun");
    replay_->end();
    SR_CHECK(check_->run());
    SR_TRY(const std::vector<uint32_t> bad, memory_->ends.bad.read<uint32_t>(device_));
    if (bad.front() == ~0u)
        return {};
    const Slot pixel = memory_->ends.latent.row_range(bad.front() / memory_->channels, 1);
    SR_TRY(const std::vector<float> values, pixel.read_rows(device_, 1));
    return not_finite(values[bad.front() % memory_->channels], bad.front(), "the denoised latent");
}

Result<std::vector<float>> AsdRenderer::finish()
{
    SR_CHECK(end());
    return memory_->ends.latent.read_rows(device_, memory_->pixels);
}

Result<std::vector<float>> AsdRenderer::render(const AsdFrame& frame, const StepCallback& callback)
{
    SR_CHECK(begin(frame));
    for (bool done = false; !done;) {
        SR_TRY(done, step(1));
        if (callback && !callback(steps_done(), steps())) {
            SR_CHECK(cancel());
            return fail(ErrorCode::interrupted, "interrupted");
        }
    }
    return finish();
}

uint32_t AsdRenderer::step_passes() const
{
    return step_ ? uint32_t(step_->plan().passes.size()) : 0;
}
uint32_t AsdRenderer::step_barriers() const
{
    return step_ ? step_->plan().barriers() : 0;
}
double AsdRenderer::host_us_per_step() const
{
    return step_ ? step_->host_us() : 0;
}
double AsdRenderer::step_flops() const
{
    double flops = 0;
    for (const Pass& pass : step_ ? step_->plan().passes : std::vector<Pass>{})
        flops += pass.options.flops;
    return flops;
}

} // namespace semrover
