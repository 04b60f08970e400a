// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/vsd.h"

#include "engine/model/renderer_model.h"
#include "engine/refine/frame_slots.h"
#include "engine/refine/known_frames.h"
#include "engine/sampling/guidance.h"

#include <algorithm>

namespace semrover {

namespace {

static_assert(kMostWindowFrames == kMostFrames);
constexpr uint32_t kFirstRows = 1; // rows of the step table before the plan's: the first state

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
    uint32_t width, height, pixels, image_rows, frames, channels, halves;
    State state;
    DenoiserTables tables;
    Slot numbers, frame_table; // of the frames; the table is computed once
    Slot table_row, frame_row; // of each image
    Slot cells, known;         // of each pixel: key of its noise, and 1 where its frame is known
    Slot x, x0, first, fixed;  // first: noise of the first state; fixed: latents of the known frames
    Slot weights;              // known_frame_weights(), where they are carried
    Slot buffer, visible, bad; // bad: first_non_finite() of each frame
    Slot velocity;             // of every half, where they are apart

    Memory(const Unet& u, const SamplingPlan& p, uint32_t text_tokens, const LatentSize& size, uint32_t frame_count,
           const VsdOptions& o)
        : unet(u), plan(p), options(o), width(size.width()), height(size.height()), pixels(size.pixels()),
          image_rows(round_up(pixels, kImageRowPadding)), frames(frame_count), channels(u.config().out_channels),
          halves(video_halves(o)), tables(state, u, p, kFirstRows, text_tokens)
    {
        const auto u32 = [&](uint32_t count, const char* name) { return state.slot(count, 1, DType::u32, name, 1); };
        numbers = state.slot(frames, 1, DType::f32, "frame numbers", 1);
        frame_table = state.slot(frames, unet.frame_width(), DType::f32, "frames");
        table_row = u32(halves * frames, "table_row");
        frame_row = u32(halves * frames, "frame_row");
        cells = state.slot(rows(), 4, DType::i32, "cells", 4);
        known = u32(rows(), "known");
        x = latent("x");
        x0 = latent("x0");
        first = latent("first noise");
        fixed = latent("known frames");
        if (o.correlation > 0)
            weights = state.slot(uint32_t(p.rows.size()) * frames, frames, DType::f32, "weights", frames);
        buffer = latent("buffer");
        visible = state.slot(rows(), 1, DType::f32, "visible", 1);
        bad = frame_words(state, frames, 1, "first number that is none");
        if (apart())
            velocity = state.slot(halves * rows(), channels, DType::f32, "velocity");
    }
    bool apart() const { return options.halves_apart && halves > 1; }
    uint32_t rows() const { return frames * image_rows; }
    Slot latent(const char* name) { return state.slot(rows(), channels, DType::f32, name); }
    Tensor normals(Graph& g, StepTable s) const
    {
        return step_noise(g, s, cells.in(g), known.in(g), channels, options.seed);
    }

    // once: what depends on the timestep, the frame's number or the text only
    Graph tables_graph() const
    {
        Graph g;
        tables.add(g, unet);
        g.keep(unet.frame_table(g, numbers.in(g)), frame_table);
        return g;
    }
    // once a window: the first state
    Graph begin_graph() const
    {
        Graph g;
        const StepTable s = tables.in(g);
        const Tensor state_x = x.in(g);
        step_hold(g, known.in(g), fixed.in(g), state_x);
        step_renoise(g, s, options.noise ? first.in(g) : g.keep(normals(g, s), first), state_x);
        step_advance(g, s.clock);
        return g;
    }
    // [videos * rows, in_channels] of that many halves -> velocity, fp32. Every image and video is at the same
    // timestep.
    Tensor forward(Graph& g, Tensor in, uint32_t videos) const
    {
        const uint32_t images = videos * frames;
        const Tensor row = table_row.in(g);
        const FrameEmbedding embedding{frames, frame_table.in(g), frame_row.in(g).row_range(0, images)};
        return unet
            .forward(g, {in, images, height, width}, tables.times.in(g), row.row_range(0, images), tables.context(g),
                     {embedding, row.row_range(0, videos)})
            .data;
    }
    Tensor evaluate(Graph& g, Tensor in) const
    {
        if (!apart())
            return forward(g, in, halves);
        g.keep_order();
        for (uint32_t half = 0; half < halves; ++half)
            g.keep(forward(g, in.row_range(half * rows(), rows()), 1), velocity.row_range(half * rows(), rows()));
        return velocity.in(g);
    }
    Graph step_graph() const
    {
        Graph g;
        const StepTable s = tables.in(g);
        const Tensor state_x = x.in(g), row = table_row.in(g);
        const RendererFrame seen{{}, buffer.in(g), visible.in(g)};
        step_timestep(g, s, row);
        const Tensor in = renderer_input(g, s, state_x, seen, halves, unet.precision());
        const FrameGuidance guidance(options.first_guidance, options.last_guidance, frames);
        step_update(g, s, evaluate(g, in), draws_noise(plan) ? normals(g, s) : first.in(g), known.in(g), fixed.in(g),
                    state_x, x0.in(g), guidance, float(plan.clip));
        if (weights.valid())
            step_carry(g, s, {weights.in(g), frames, kFirstRows}, known.in(g), fixed.in(g), state_x, x0.in(g));
        step_advance(g, s.clock);
        return g;
    }
    Graph check_graph() const
    {
        Graph g;
        check_frames(g, x, frames, {width, height, width, height}, bad);
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
    SR_CHECK(check_guidance(options.first_guidance));
    SR_CHECK(check_guidance(options.last_guidance));
    if (!(options.correlation >= 0 && options.correlation < 1))
        return fail(ErrorCode::usage, "a correlation of {} between frames, expected 0 to less than 1",
                    options.correlation);
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
    SR_TRY(const Plan check, make_plan(m.check_graph().desc(), limits));
    return AsdRenderer::Bytes{
        m.state.planned_bytes(limits),
        std::max(tables.arena_bytes(), begin.arena_bytes() + step.arena_bytes() + check.arena_bytes())};
}

Status VsdRenderer::make_tables(const VideoConditioning& conditioning)
{
    const Memory& m = *memory_;
    StepRow first = first_noise_row(plan_.init_noise_sigma, kFirstDraw);
    first.c_x = float(plan_.init_known_scale); // x is zero but where a frame is known
    SR_CHECK(m.tables.write(device_, plan_, std::span(&first, 1), conditioning));
    std::vector<float> numbers;
    std::vector<uint32_t> frame_rows;
    for (uint32_t f = 0; f < m.frames; ++f)
        numbers.push_back(float(f));
    for (uint32_t i = 0; i < m.halves * m.frames; ++i)
        frame_rows.push_back(i % m.frames);
    SR_CHECK(m.numbers.write(device_, numbers));
    SR_CHECK(m.frame_row.write(device_, frame_rows));
    SR_TRY(const auto tables, Program::create(device_, m.tables_graph()));
    return tables->run();
}

Status VsdRenderer::make_programs()
{
    if (step_)
        return {};
    SR_TRY(begin_, Program::create(device_, memory_->begin_graph()));
    SR_TRY(step_, Program::create(device_, memory_->step_graph()));
    SR_TRY(check_, Program::create(device_, memory_->check_graph()));
    replay_.emplace(device_, plan_.rows.size(), [this](size_t) -> Result<Program*> { return step_.get(); });
    return {};
}

void VsdRenderer::rest()
{
    replay_.reset();
    begin_.reset();
    step_.reset();
    check_.reset();
}

Status VsdRenderer::upload(const VsdWindow& w)
{
    const Memory& m = *memory_;
    const size_t frame = size_t(m.pixels) * m.channels, known = w.known.size() / frame;
    SR_ASSERT(w.visible.size() == size_t(m.frames) * m.pixels && w.buffers.size() == m.frames * frame &&
                  w.known.size() == known * frame && known <= m.frames,
              "a window of {} values, {} of them known, for {} frames of {} pixels", w.buffers.size(), w.known.size(),
              m.frames, m.pixels);
    SR_CHECK(write_frames(device_, m.buffer, m.frames, w.buffers));
    SR_CHECK(write_frames(device_, m.visible, m.frames, w.visible));
    SR_CHECK(m.fixed.clear(device_));
    for (uint32_t f = 0; f < known; ++f)
        SR_CHECK(frame_of(m.fixed, m.frames, f).write_rows(device_, w.known.subspan(f * frame, frame)));
    std::vector<uint32_t> is_known(m.rows(), 0);
    std::fill_n(is_known.begin(), known * m.image_rows, 1u);
    SR_CHECK(m.known.write(device_, is_known));
    if (m.weights.valid())
        SR_CHECK(m.weights.write(device_, known_frame_weights(plan_, m.frames, uint32_t(known), options_.correlation)));
    return upload_keys(w);
}

// where noise comes from
Status VsdRenderer::upload_keys(const VsdWindow& w)
{
    const Memory& m = *memory_;
    SR_ASSERT(w.keys.empty() || w.keys.size() == size_t(m.frames) * m.pixels, "{} keys for {} frames of {} pixels",
              w.keys.size(), m.frames, m.pixels);
    std::vector<int32_t> cells(m.rows() * 4ull, 0);
    for (uint32_t r = 0; r < m.rows(); ++r) {
        const uint32_t frame = r / m.image_rows, pixel = r % m.image_rows;
        NoiseKey key{pixel, w.number + frame};
        if (!w.keys.empty() && pixel < m.pixels)
            key = w.keys[size_t(frame) * m.pixels + pixel];
        cells[4 * r] = int32_t(key.pixel);
        cells[4 * r + 1] = int32_t(key.frame);
        cells[4 * r + 2] = int32_t(w.chain);
    }
    SR_CHECK(m.cells.write(device_, cells));
    if (!options_.noise)
        return {};
    std::vector<float> noise(size_t(m.frames) * m.pixels * m.channels);
    options_.noise(w.number, noise);
    return write_frames(device_, m.first, m.frames, noise);
}

Status VsdRenderer::begin(const VsdWindow& window)
{
    SR_CHECK(make_programs());
    SR_CHECK(replay_->begin({memory_->tables.clock, memory_->x, memory_->x0}));
    SR_CHECK(upload(window));
    return begin_->run();
}

Result<bool> VsdRenderer::step(size_t submits)
{
    SR_ASSERT(replay_, "a step of a renderer that has not begun a window");
    return replay_->step(submits);
}

Status VsdRenderer::cancel()
{
    return replay_ ? replay_->cancel() : Status{};
}

Status VsdRenderer::check()
{
    const Memory& m = *memory_;
    SR_CHECK(check_->run());
    return check_frame_words(device_, m.bad, m.x, m.frames, {m.width, m.height, m.width, m.height},
                             "the denoised latent");
}

Result<std::vector<float>> VsdRenderer::finish()
{
    SR_ASSERT(replay_, "a window is finished that has not begun");
    replay_->end();
    SR_CHECK(check());
    return state();
}

Result<std::vector<float>> VsdRenderer::state() const
{
    return read_frames(device_, memory_->x, memory_->frames, memory_->pixels);
}

Result<std::vector<float>> VsdRenderer::render(const VsdWindow& window, const StepCallback& callback)
{
    SR_CHECK(begin(window));
    for (bool done = false; !done;) {
        SR_TRY(done, step(1));
        if (callback && !callback(replay_->rows_done(), steps())) {
            SR_CHECK(cancel());
            return fail(ErrorCode::interrupted, "interrupted");
        }
    }
    return finish();
}

uint32_t VsdRenderer::frames() const
{
    return memory_->frames;
}

uint64_t VsdRenderer::arena_bytes() const
{
    return step_ ? begin_->plan().arena_bytes() + step_->plan().arena_bytes() + check_->plan().arena_bytes() : 0;
}

} // namespace semrover
