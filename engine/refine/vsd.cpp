// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/vsd.h"

#include "engine/refine/frame_slots.h"
#include "engine/sampling/step_rows.h"
#include "kernels/sampling.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr uint32_t kFirstRows = 1; // rows of the step table before the plan's: the first state

bool in_range(float guidance)
{
    return guidance >= 0 && guidance <= 1000;
}

uint32_t video_halves(const VsdOptions& o)
{
    return o.first_guidance == 1.f && o.last_guidance == 1.f ? 1 : 2;
}

} // namespace

// what stays on the device from step to step, and the graphs over it
struct VsdRenderer::Memory {
    const Unet& unet;
    const SamplingPlan& plan;
    const VsdOptions& options;
    uint32_t width, height, pixels, image_rows, frames, channels, halves, tokens;
    State state;
    Slot steps, clock, timesteps, added, numbers, context;
    Slot times, frame_table, text; // computed once
    Slot table_row, frame_row;     // of each image
    Slot cells, known, x, x0, buffer, visible;
    Slot noise; // where it comes from the host

    Memory(const Unet& u, const SamplingPlan& p, uint32_t text_tokens, const LatentSize& size, uint32_t frame_count,
           const VsdOptions& o)
        : unet(u), plan(p), options(o), width(size.width()), height(size.height()), pixels(size.pixels()),
          image_rows(round_up(pixels, kImageRowPadding)), frames(frame_count), channels(u.config().out_channels),
          halves(video_halves(o)), tokens(text_tokens)
    {
        declare_tables();
        const auto u32 = [&](uint32_t count, const char* name) { return state.slot(count, 1, DType::u32, name, 1); };
        table_row = u32(halves * frames, "table_row");
        frame_row = u32(halves * frames, "frame_row");
        cells = state.slot(rows(), 4, DType::i32, "cells", 4);
        known = u32(rows(), "known");
        x = latent("x");
        x0 = latent("x0");
        buffer = latent("buffer");
        visible = state.slot(rows(), 1, DType::f32, "visible", 1);
        if (o.noise)
            noise = latent("noise");
    }
    void declare_tables()
    {
        constexpr uint32_t kWords = sizeof(StepRow) / 4;
        const uint32_t count = uint32_t(plan.timesteps.size()), numbers_of_video = unet.config().added_numbers;
        steps = state.slot(uint32_t(plan.rows.size()) + kFirstRows, kWords, DType::u32, "steps", kWords);
        clock = ReplayMemory::clock_slot(state);
        timesteps = state.slot(count, 1, DType::f32, "timesteps", 1);
        added = state.slot(count, numbers_of_video, DType::f32, "added numbers", numbers_of_video);
        numbers = state.slot(frames, 1, DType::f32, "frame numbers", 1);
        context = state.slot(tokens, unet.config().cross_attention_dim, unet.precision(), "conditioning");
        times = state.slot(count, unet.time_width(), DType::f32, "times");
        frame_table = state.slot(frames, unet.frame_width(), DType::f32, "frames");
        text = state.slot(tokens, unet.context_width(), unet.precision(), "text");
    }
    uint32_t rows() const { return frames * image_rows; }
    Slot latent(const char* name) { return state.slot(rows(), channels, DType::f32, name); }
    StepTable step_table(Graph& g) const { return {steps.in(g), clock.in(g)}; }
    Tensor normals(Graph& g, StepTable s) const
    {
        return step_noise(g, s, cells.in(g), known.in(g), channels, options.seed);
    }

    // once: what depends on the timestep, the frame's number or the text only
    Graph tables_graph() const
    {
        Graph g;
        g.keep(unet.time_table(g, timesteps.in(g), {}, added.in(g)), times);
        g.keep(unet.frame_table(g, numbers.in(g)), frame_table);
        g.keep(unet.context_table(g, context.in(g)), text);
        return g;
    }
    // once a window: the first state
    Graph begin_graph() const
    {
        Graph g;
        const StepTable s = step_table(g);
        step_renoise(g, s, noise.valid() ? noise.in(g) : normals(g, s), x.in(g));
        step_advance(g, s.clock);
        return g;
    }
    Graph step_graph() const
    {
        Graph g;
        const StepTable s = step_table(g);
        const Tensor state_x = x.in(g), row = table_row.in(g);
        const RendererFrame seen{{}, buffer.in(g), visible.in(g)};
        step_timestep(g, s, row);
        const Tensor in = renderer_input(g, s, state_x, seen, halves, unet.precision());
        // note: every image and video is at the same timestep
        const Unet::Videos videos{{frames, frame_table.in(g), frame_row.in(g)}, row.row_range(0, halves)};
        const FeatureMap m =
            unet.forward(g, {in, halves * frames, height, width}, times.in(g), row, {text.in(g), tokens, 0}, videos);
        const FrameGuidance guidance(options.first_guidance, options.last_guidance, frames);
        step_update(g, s, m.data, draws_noise(plan) ? normals(g, s) : seen.buffer, known.in(g), seen.buffer, state_x,
                    x0.in(g), guidance, float(plan.clip));
        step_advance(g, s.clock);
        return g;
    }
};

VsdRenderer::VsdRenderer(Device& device, const SamplingPlan& plan, VsdOptions options)
    : device_(device), plan_(plan), options_(std::move(options))
{
}
VsdRenderer::~VsdRenderer() = default;

namespace {

Status check_video_renderer(const Unet& unet, const VideoConditioning& conditioning, uint32_t frames,
                            const VsdOptions& options)
{
    if (!in_range(options.first_guidance) || !in_range(options.last_guidance))
        return fail(ErrorCode::usage, "guidance from {} to {} is not in 0..1000", options.first_guidance,
                    options.last_guidance);
    if (frames < 1 || frames > kMostFrames)
        return fail(ErrorCode::usage, "a window of {} frames, expected 1 to {}", frames, kMostFrames);
    const UnetConfig& c = unet.config();
    if (!c.video)
        return fail(ErrorCode::bad_input, "the UNet is one of single images, the video renderer wants one of videos");
    if (c.in_channels != 2 * c.out_channels + 1)
        return fail(ErrorCode::bad_input,
                    "the UNet takes {} channels, the video renderer gives it {}: noisy and buffer latent of {} each, "
                    "and visibility",
                    c.in_channels, 2 * c.out_channels + 1, c.out_channels);
    if (conditioning.added.size() != c.added_numbers)
        return fail(ErrorCode::bad_input, "the UNet takes {} numbers with a video, not {}", c.added_numbers,
                    conditioning.added.size());
    return {};
}

} // namespace

Result<std::unique_ptr<VsdRenderer>> VsdRenderer::create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                         const VideoConditioning& conditioning, const LatentSize& size,
                                                         uint32_t frames, VsdOptions options)
{
    SR_CHECK(check_video_renderer(unet, conditioning, frames, options));
    std::unique_ptr<VsdRenderer> r(new VsdRenderer(device, plan, std::move(options)));
    r->memory_ = std::make_unique<Memory>(unet, r->plan_, conditioning.text.tokens, size, frames, r->options_);
    SR_CHECK(r->memory_->state.allocate(device, "video renderer state"));
    SR_CHECK(r->make_tables(conditioning));
    return r;
}

Result<AsdRenderer::Bytes> VsdRenderer::planned_bytes(const DeviceLimits& limits, const Unet& unet,
                                                      const SamplingPlan& plan, uint32_t text_tokens,
                                                      const LatentSize& size, uint32_t frames,
                                                      const VsdOptions& options)
{
    const Memory m(unet, plan, text_tokens, size, frames, options);
    SR_TRY(const Plan tables, make_plan(m.tables_graph().desc(), limits));
    SR_TRY(const Plan begin, make_plan(m.begin_graph().desc(), limits));
    SR_TRY(const Plan step, make_plan(m.step_graph().desc(), limits));
    return AsdRenderer::Bytes{m.state.planned_bytes(limits),
                              std::max(tables.arena_bytes(), begin.arena_bytes() + step.arena_bytes())};
}

Status VsdRenderer::make_tables(const VideoConditioning& conditioning)
{
    const Memory& m = *memory_;
    std::vector<StepRow> rows{first_noise_row(plan_.init_noise_sigma, kFirstDraw)};
    std::ranges::transform(plan_.rows, std::back_inserter(rows), step_row);
    SR_CHECK(m.steps.write(device_, rows));
    SR_CHECK(m.clock.clear(device_));
    SR_CHECK(m.timesteps.write(device_, std::vector<float>(plan_.timesteps.begin(), plan_.timesteps.end())));
    std::vector<float> added, numbers;
    for (size_t i = 0; i < plan_.timesteps.size(); ++i)
        added.insert(added.end(), conditioning.added.begin(), conditioning.added.end());
    std::vector<uint32_t> frame_rows;
    for (uint32_t i = 0; i < m.halves * m.frames; ++i)
        frame_rows.push_back(i % m.frames);
    for (uint32_t f = 0; f < m.frames; ++f)
        numbers.push_back(float(f));
    SR_CHECK(m.added.write(device_, added));
    SR_CHECK(m.numbers.write(device_, numbers));
    SR_CHECK(m.frame_row.write(device_, frame_rows));
    SR_CHECK(m.context.write_rows(device_, conditioning.text.values));
    SR_CHECK(m.known.clear(device_));
    SR_TRY(const auto tables, Program::create(device_, m.tables_graph()));
    return tables->run();
}

Status VsdRenderer::make_programs()
{
    if (step_)
        return {};
    SR_TRY(begin_, Program::create(device_, memory_->begin_graph()));
    SR_TRY(step_, Program::create(device_, memory_->step_graph()));
    replay_.emplace(device_, ReplayMemory{memory_->clock, memory_->x, memory_->x0}, plan_.rows.size(),
                    [this](size_t) -> Result<Program*> { return step_.get(); });
    return {};
}

Status VsdRenderer::upload(const VsdWindow& window)
{
    const Memory& m = *memory_;
    SR_ASSERT(window.visible.size() == size_t(m.frames) * m.pixels &&
                  window.buffers.size() == window.visible.size() * m.channels,
              "a window of {} values for {} frames of {} pixels", window.buffers.size(), m.frames, m.pixels);
    SR_CHECK(write_frames(device_, m.buffer, m.frames, window.buffers));
    SR_CHECK(write_frames(device_, m.visible, m.frames, window.visible));
    std::vector<int32_t> cells(m.rows() * 4ull, 0);
    for (uint32_t r = 0; r < m.rows(); ++r) {
        cells[4 * r] = int32_t(r % m.image_rows);
        cells[4 * r + 1] = int32_t(window.number + r / m.image_rows);
        cells[4 * r + 2] = int32_t(window.chain);
    }
    SR_CHECK(m.cells.write(device_, cells));
    if (!m.noise.valid())
        return {};
    std::vector<float> noise(size_t(m.frames) * m.pixels * m.channels);
    options_.noise(window.number, noise);
    return write_frames(device_, m.noise, m.frames, noise);
}

Result<std::vector<float>> VsdRenderer::read() const
{
    const Memory& m = *memory_;
    SR_TRY(std::vector<float> latents, read_frames(device_, m.x, m.frames, m.pixels));
    SR_CHECK(check_finite(latents, "the denoised latent"));
    return latents;
}

Result<std::vector<float>> VsdRenderer::render(const VsdWindow& window, const StepCallback& callback)
{
    SR_CHECK(make_programs());
    SR_CHECK(replay_->begin(kFirstRows));
    SR_CHECK(upload(window));
    SR_CHECK(begin_->run());
    for (bool done = false; !done;) {
        SR_TRY(done, replay_->step(1));
        if (callback && !callback(replay_->row(), steps())) {
            SR_CHECK(replay_->cancel());
            return fail(ErrorCode::interrupted, "interrupted");
        }
    }
    replay_->end();
    return read();
}

uint64_t VsdRenderer::arena_bytes() const
{
    return step_ ? begin_->plan().arena_bytes() + step_->plan().arena_bytes() : 0;
}

} // namespace semrover
