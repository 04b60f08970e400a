// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/asd.h"

#include "engine/sampling/step_rows.h"
#include "kernels/sampling.h"

#include <algorithm>
#include <deque>

namespace semrover {

namespace {

constexpr size_t kInFlight = 3;    // submits ahead of the device
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
    uint32_t width, height, pixels, rows, channels, halves, tokens;
    bool fed; // noise comes from the host
    Arena arena;
    uint32_t steps, clock, timesteps, table, context, context_table, table_row;
    uint32_t cells, known, x, x0, previous, buffer, visible, first_noise = 0, previous_noise = 0;

    Memory(const Unet& u, const SamplingPlan& p, uint32_t text_tokens, const LatentSize& size, float guidance_scale,
           bool noise_from_host)
        : unet(u), plan(p), width(size.width()), height(size.height()), pixels(size.pixels()),
          rows(round_up(pixels, kImageRowPadding)), channels(u.config().out_channels),
          halves(halves_of(guidance_scale)), tokens(text_tokens), fed(noise_from_host)
    {
        const uint64_t latent = latent_values() * 4, element = dtype_bytes(u.precision());
        steps = arena.add((plan.rows.size() + kNoiseRows) * sizeof(StepRow));
        clock = arena.add(sizeof(StepClock));
        timesteps = arena.add(plan.timesteps.size() * 4);
        table = arena.add(plan.timesteps.size() * round_up(u.time_width(), kRowPadding) * 4);
        context = arena.add(uint64_t(token_rows()) * text_ld() * element);
        context_table = arena.add(uint64_t(token_rows()) * round_up(u.context_width(), kRowPadding) * element);
        table_row = arena.add(halves * 4ull);
        cells = arena.add(rows * 16ull);
        known = arena.add(rows * 4ull);
        for (uint32_t* state : {&x, &x0, &previous, &buffer})
            *state = arena.add(latent);
        visible = arena.add(rows * 4ull);
        if (fed) {
            first_noise = arena.add(latent);
            previous_noise = arena.add(latent);
        }
    }
    uint32_t ld() const { return round_up(channels, kRowPadding); }
    uint64_t latent_values() const { return uint64_t(rows) * ld(); }
    uint32_t token_rows() const { return round_up(tokens, kImageRowPadding); }
    uint32_t text_ld() const { return round_up(unet.config().cross_attention_dim, kRowPadding); }

    Tensor latent(Graph& g, uint32_t id, const char* name) const
    {
        return g.external(arena.slice(id), rows, channels, DType::f32, name);
    }
    Tensor words(Graph& g, uint32_t id, uint32_t count, const char* name) const
    {
        return g.external(arena.slice(id), count, 1, DType::u32, name, 1);
    }
    StepTable step_table(Graph& g) const
    {
        constexpr uint32_t kWords = sizeof(StepRow) / 4;
        const uint32_t count = uint32_t(plan.rows.size()) + kNoiseRows;
        return {g.external(arena.slice(steps), count, kWords, DType::u32, "steps", kWords),
                g.external(arena.slice(clock), 1, 2, DType::u32, "clock", 2)};
    }
    Tensor time_table(Graph& g) const
    {
        return g.external(arena.slice(table), uint32_t(plan.timesteps.size()), unet.time_width(), DType::f32, "times");
    }
    Tensor text_table(Graph& g) const
    {
        return g.external(arena.slice(context_table), token_rows(), unet.context_width(), unet.precision(), "text");
    }
    Tensor noise(Graph& g, StepTable table_of_steps, uint64_t seed) const
    {
        const Tensor keys = g.external(arena.slice(cells), rows, 4, DType::i32, "cells", 4);
        return step_noise(g, table_of_steps, keys, words(g, known, rows, "known"), channels, seed);
    }

    // once: what depends on the timestep or the text only
    Graph tables_graph() const
    {
        Graph g;
        const uint32_t times = uint32_t(plan.timesteps.size());
        unet.time_table(g, g.external(arena.slice(timesteps), times, 1, DType::f32, "timesteps", 1), time_table(g));
        const Tensor text = g.external(arena.slice(context), token_rows(), unet.config().cross_attention_dim,
                                       unet.precision(), "conditioning");
        unet.context_table(g, text, text_table(g));
        return g;
    }
    // once a frame: the first state, and the noise on the previous latent
    Graph begin_graph(uint64_t seed) const
    {
        Graph g;
        const StepTable s = step_table(g);
        const Tensor first = fed ? latent(g, first_noise, "first noise") : noise(g, s, seed);
        step_renoise(g, s, first, latent(g, x, "x"));
        step_advance(g, s.clock);
        const Tensor more = fed ? latent(g, previous_noise, "previous noise") : noise(g, s, seed);
        step_renoise(g, s, more, latent(g, previous, "previous"));
        step_advance(g, s.clock);
        return g;
    }
    Graph step_graph(float guidance_scale, uint64_t seed) const
    {
        Graph g;
        const StepTable s = step_table(g);
        const Tensor row = words(g, table_row, halves, "table_row"), state = latent(g, x, "x");
        const RendererFrame frame{latent(g, previous, "previous"), latent(g, buffer, "buffer"),
                                  g.external(arena.slice(visible), rows, 1, DType::f32, "visible", 1)};
        step_timestep(g, s, row);
        const Tensor in = renderer_input(g, s, state, frame, halves, unet.precision());
        const Unet::Context text{text_table(g), tokens, 0};
        const FeatureMap m = unet.forward(g, {in, halves, height, width}, time_table(g), row, text);
        // samplers without noise take any finite numbers for it
        const bool noisy = std::ranges::any_of(plan.rows, [](const PlanRow& r) { return r.coefficients.c_z != 0; });
        const Tensor z = noisy ? noise(g, s, seed) : frame.buffer;
        step_update(g, s, m.data, z, words(g, known, rows, "known"), frame.buffer, state, latent(g, x0, "x0"),
                    guidance_scale, float(plan.clip));
        step_advance(g, s.clock);
        return g;
    }

    // [pixels, C] with rows as on the device
    std::vector<float> padded(std::span<const float> values) const
    {
        std::vector<float> out(latent_values(), 0.f);
        for (size_t i = 0; i < values.size(); ++i)
            out[i / channels * ld() + i % channels] = values[i];
        return out;
    }
};

AsdRenderer::AsdRenderer(Device& device, const Unet& unet, const SamplingPlan& plan, AsdOptions options)
    : device_(device), unet_(unet), plan_(plan), options_(std::move(options))
{
}
AsdRenderer::~AsdRenderer() = default;

Result<std::unique_ptr<AsdRenderer>> AsdRenderer::create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                         const Conditioning& text, const LatentSize& size,
                                                         AsdOptions options)
{
    if (!(options.guidance_scale >= 0 && options.guidance_scale <= 1000))
        return fail(ErrorCode::usage, "guidance scale {} is not in 0..1000", options.guidance_scale);
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
    std::unique_ptr<AsdRenderer> r(new AsdRenderer(device, unet, plan, std::move(options)));
    r->memory_ = std::make_unique<Memory>(unet, r->plan_, text.tokens, size, r->options_.guidance_scale,
                                          bool(r->options_.noise));
    SR_CHECK(r->memory_->arena.allocate(device, "renderer state"));
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
    return Bytes{m.arena.planned_bytes(limits),
                 std::max(tables.arena_bytes(), begin.arena_bytes() + step.arena_bytes())};
}

Status AsdRenderer::make_tables(const Conditioning& text)
{
    const Memory& m = *memory_;
    std::vector<StepRow> rows{first_noise_row(plan_.init_noise_sigma, kFirstDraw),
                              more_noise_row(options_.previous_noise, kPreviousFrameDraw)};
    std::ranges::transform(plan_.rows, std::back_inserter(rows), step_row);
    SR_CHECK(device_.write(m.arena.slice(m.steps), std::as_bytes(std::span(rows))));
    const std::vector<float> times(plan_.timesteps.begin(), plan_.timesteps.end());
    SR_CHECK(device_.write(m.arena.slice(m.timesteps), std::as_bytes(std::span(times))));
    const uint32_t dim = unet_.config().cross_attention_dim;
    SR_ASSERT(text.values.size() == size_t(text.tokens) * dim, "{} numbers of conditioning for {} tokens of {}",
              text.values.size(), text.tokens, dim);
    std::vector<float> padded(size_t(m.token_rows()) * m.text_ld(), 0.f);
    for (size_t i = 0; i < text.values.size(); ++i)
        padded[i / dim * m.text_ld() + i % dim] = text.values[i];
    if (unet_.precision() == DType::f16) {
        std::vector<uint16_t> halves(padded.size());
        std::ranges::transform(padded, halves.begin(), float_to_half);
        SR_CHECK(device_.write(m.arena.slice(m.context), std::as_bytes(std::span(halves))));
    } else {
        SR_CHECK(device_.write(m.arena.slice(m.context), std::as_bytes(std::span(padded))));
    }
    SR_CHECK(device_.clear(m.arena.slice(m.known)));
    SR_TRY(const auto tables, Program::create(device_, m.tables_graph()));
    return tables->run();
}

Status AsdRenderer::make_programs()
{
    if (step_)
        return {};
    SR_TRY(begin_, Program::create(device_, memory_->begin_graph(options_.seed)));
    SR_TRY(step_, Program::create(device_, memory_->step_graph(options_.guidance_scale, options_.seed)));
    return {};
}

void AsdRenderer::rest()
{
    begin_.reset();
    step_.reset();
}

Status AsdRenderer::upload(const AsdFrame& frame)
{
    const Memory& m = *memory_;
    const size_t values = size_t(m.pixels) * m.channels;
    SR_ASSERT(frame.buffer.size() == values && frame.visible.size() == m.pixels &&
                  (frame.previous.empty() || frame.previous.size() == values) &&
                  (frame.keys.empty() || frame.keys.size() == m.pixels),
              "a frame of {} values for {} pixels", frame.buffer.size(), m.pixels);
    const auto write = [&](uint32_t id, const auto& array) {
        return device_.write(m.arena.slice(id), std::as_bytes(std::span(array)));
    };
    std::vector<int32_t> cells(m.rows * 4ull, 0);
    for (uint32_t r = 0; r < m.rows; ++r) {
        const NoiseKey key = r < frame.keys.size() ? frame.keys[r] : NoiseKey{r, frame.number};
        cells[4 * r] = int32_t(key.pixel);
        cells[4 * r + 1] = int32_t(key.frame);
        cells[4 * r + 2] = int32_t(frame.chain);
    }
    std::vector<float> visible(frame.visible.begin(), frame.visible.end());
    visible.resize(m.rows);
    SR_CHECK(write(m.cells, cells));
    SR_CHECK(write(m.visible, visible));
    SR_CHECK(write(m.buffer, m.padded(frame.buffer)));
    SR_CHECK(write(m.previous, m.padded(frame.previous)));
    SR_CHECK(device_.clear(m.arena.slice(m.x)));
    SR_CHECK(device_.clear(m.arena.slice(m.x0)));
    if (m.fed) {
        std::vector<float> initial(values), previous(values);
        options_.noise(frame.number, initial, previous);
        SR_CHECK(write(m.first_noise, m.padded(initial)));
        SR_CHECK(write(m.previous_noise, m.padded(previous)));
    }
    const StepClock clock{0, 0};
    return device_.write(m.arena.slice(m.clock), std::as_bytes(std::span(&clock, 1)));
}

Status AsdRenderer::begin(const AsdFrame& frame)
{
    SR_CHECK(make_programs());
    SR_CHECK(upload(frame));
    SR_CHECK(begin_->run());
    // note: the first frame has nothing before it, not even noise
    return frame.previous.empty() ? device_.clear(memory_->arena.slice(memory_->previous)) : Status{};
}

Status AsdRenderer::run_steps(const StepCallback& callback)
{
    std::deque<uint64_t> flight;
    const size_t total = plan_.rows.size();
    // a CPU gains nothing from steps ahead, and a run that is stopped would wait for them
    const size_t ahead = device_.limits().type == DeviceType::cpu || device_.profile() ? 0 : kInFlight;
    for (size_t done = 1; done <= total; ++done) {
        SR_TRY(const uint64_t ticket, step_->submit());
        flight.push_back(ticket);
        if (flight.size() > ahead) {
            SR_CHECK(device_.wait(flight.front()));
            flight.pop_front();
            SR_CHECK(step_->collect_profile());
        }
        if (callback && !callback(done, total))
            return fail(ErrorCode::interrupted, "interrupted");
    }
    return device_.wait(device_.last_ticket());
}

Result<std::vector<float>> AsdRenderer::render(const AsdFrame& frame, const StepCallback& callback)
{
    SR_CHECK(begin(frame));
    SR_CHECK(run_steps(callback));
    const Memory& m = *memory_;
    std::vector<float> rows(m.latent_values());
    SR_CHECK(device_.read(m.arena.slice(m.x), std::as_writable_bytes(std::span(rows))));
    std::vector<float> latent(size_t(m.pixels) * m.channels);
    for (size_t i = 0; i < latent.size(); ++i)
        latent[i] = rows[i / m.channels * m.ld() + i % m.channels];
    SR_CHECK(check_finite(latent, "the denoised latent"));
    return latent;
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
