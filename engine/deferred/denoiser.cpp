// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/denoiser.h"

#include "engine/deferred/frame_slots.h"

#include <algorithm>

namespace semrover {

DenoiserTables::DenoiserTables(TensorPool& state, const Unet& unet, const SamplingPlan& plan, uint32_t rows_before,
                               uint32_t text_tokens)
    : first_rows(rows_before), tokens(text_tokens)
{
    constexpr uint32_t kWords = sizeof(StepRow) / 4;
    const uint32_t count = uint32_t(plan.timesteps.size()), numbers = unet.config().added_numbers;
    steps = state.tensor(uint32_t(plan.rows.size()) + first_rows, kWords, DType::u32, "steps", kWords);
    clock = StepMemory::clock_tensor(state);
    timesteps_ = state.tensor(count, 1, DType::f32, "timesteps", 1);
    times = state.tensor(count, unet.time_width(), DType::f32, "times");
    if (numbers)
        added_ = state.tensor(count, numbers, DType::f32, "added numbers", numbers);
    if (const uint32_t rows = round_up(tokens, kImageRowPadding); rows && unet.context_width()) {
        context_ = state.tensor(rows, unet.config().cross_attention_dim, unet.precision(), "conditioning");
        text = state.tensor(rows, unet.context_width(), unet.precision(), "text");
    }
}

void DenoiserTables::add(Graph& g, const Unet& unet) const
{
    g.keep(unet.time_table(g, timesteps_.in(g), {}, added_.in(g)), times);
    if (text.valid())
        g.keep(unet.context_table(g, context_.in(g)), text);
}

Status DenoiserTables::write(Device& device, const SamplingPlan& plan, std::span<const StepRow> before,
                             const Conditioning& conditioning) const
{
    SR_ASSERT(before.size() == first_rows, "{} rows before a plan, {} were declared", before.size(), first_rows);
    std::vector<StepRow> rows(before.begin(), before.end());
    std::ranges::transform(plan.rows, std::back_inserter(rows), step_row);
    SR_CHECK(steps.write(device, rows));
    SR_CHECK(clock.clear(device));
    SR_CHECK(timesteps_.write(device, std::vector<float>(plan.timesteps.begin(), plan.timesteps.end())));
    if (added_.valid()) {
        std::vector<float> added; // the same with every timestep
        for (uint32_t i = 0; i < added_.rows(); ++i)
            added.insert(added.end(), conditioning.added.begin(), conditioning.added.end());
        SR_CHECK(added_.write(device, added));
    }
    if (!context_.valid())
        return {};
    const std::span<const float> values = conditioning.text;
    SR_ASSERT(values.size() == size_t(tokens) * context_.cols(), "{} numbers of conditioning for {} tokens of {}",
              values.size(), tokens, context_.cols());
    return context_.write_rows(device, values);
}

Denoiser::Memory::Memory(const Unet& u, const SamplingPlan& p, const Shape& shape, uint64_t noise_seed)
    : unet(u), plan(p), seed(noise_seed), width(shape.size.width()), height(shape.size.height()),
      pixels(shape.size.pixels()), image_rows(round_up(pixels, kImageRowPadding)), frames(shape.frames),
      channels(u.config().out_channels), halves(shape.halves), tables(state, u, p, shape.rows_before, shape.text_tokens)
{
    table_row = state.tensor(halves * frames, 1, DType::u32, "table_row", 1);
    cells = state.tensor(rows(), 4, DType::i32, "cells", 4);
    known = state.tensor(rows(), 1, DType::u32, "known", 1);
    x = latent("x");
    x0 = latent("x0");
    buffer = latent("buffer");
    visible = state.tensor(rows(), 1, DType::f32, "visible", 1);
    bad = frame_words(state, frames, 1, "first number that is none");
}

Tensor Denoiser::Memory::normals(Graph& g, StepTable steps) const
{
    return step_noise(g, steps, cells.in(g), known.in(g), channels, seed);
}

Graph Denoiser::Memory::tables_graph(const DeviceLimits& limits) const
{
    Graph g(limits);
    tables.add(g, unet);
    return g;
}

Graph Denoiser::Memory::check_graph(const DeviceLimits& limits) const
{
    Graph g(limits);
    check_frames(g, x, frames, {width, height, width, height}, bad);
    return g;
}

Result<PartBytes> Denoiser::Memory::planned(const DeviceLimits& limits) const
{
    PartBytes bytes{state.planned_bytes(limits), {}};
    for (const Graph& g : {tables_graph(limits), begin_graph(limits), step_graph(limits), check_graph(limits)}) {
        SR_TRY(const Plan plan, make_plan(g));
        bytes.arena.cover({plan.blocks});
    }
    return bytes;
}

Denoiser::~Denoiser() = default;

Status Denoiser::make(std::unique_ptr<Memory> memory, std::span<const StepRow> before, const Conditioning& conditioning,
                      SharedArena arena)
{
    memory_ = std::move(memory);
    const Memory& m = *memory_;
    SR_CHECK(memory_->state.allocate(device_, "a renderer's latents"));
    if (!arena) {
        SR_TRY(const PartBytes planned, m.planned(device_.limits()));
        SR_TRY(arena, Arena::create(device_, planned.arena));
    }
    SR_CHECK(m.tables.write(device_, plan_, before, conditioning));
    SR_CHECK(m.known.clear(device_));
    SR_CHECK(write_tables());
    arena_ = std::move(arena);
    SR_TRY(const auto tables, arena_->executable(m.tables_graph(device_.limits())));
    SR_CHECK(tables->run());
    SR_TRY(begin_, arena_->executable(m.begin_graph(device_.limits())));
    SR_TRY(step_, arena_->executable(m.step_graph(device_.limits())));
    SR_TRY(check_, arena_->executable(m.check_graph(device_.limits())));
    loop_.emplace(device_, plan_.rows.size(), [this](size_t) -> Result<Executable*> { return step_.get(); });
    return {};
}

// where noise comes from
Status Denoiser::upload_keys(const DenoiserWindow& w) const
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
    return m.cells.write(device_, cells);
}

Status Denoiser::begin(const DenoiserWindow& w)
{
    const Memory& m = *memory_;
    SR_ASSERT(w.visible.size() == size_t(m.frames) * m.pixels && w.buffers.size() == w.visible.size() * m.channels,
              "a window of {} values for {} frames of {} pixels", w.buffers.size(), m.frames, m.pixels);
    SR_CHECK(loop_->begin({m.tables.clock, m.x, m.x0}));
    SR_CHECK(write_frames(device_, m.buffer, m.frames, w.buffers));
    SR_CHECK(write_frames(device_, m.visible, m.frames, w.visible));
    SR_CHECK(upload(w));
    SR_CHECK(upload_keys(w));
    SR_CHECK(begin_->run());
    return after_begin(w);
}

Result<bool> Denoiser::step(size_t submits)
{
    return loop_->step(submits);
}

Status Denoiser::cancel()
{
    return loop_->cancel();
}

Result<std::vector<float>> Denoiser::finish()
{
    loop_->end();
    SR_CHECK(check_->run());
    const Memory& m = *memory_;
    SR_CHECK(check_frame_words(device_, m.bad, m.x, m.frames, {m.width, m.height, m.width, m.height},
                               "the denoised latent"));
    return state();
}

Result<std::vector<float>> Denoiser::state() const
{
    return read_frames(device_, memory_->x, memory_->frames, memory_->pixels);
}

Result<std::vector<float>> Denoiser::render(const DenoiserWindow& window, const StepCallback& callback)
{
    SR_CHECK(begin(window));
    for (bool done = false; !done;) {
        SR_TRY(done, step(1));
        if (callback && !callback(steps_done(), steps())) {
            SR_CHECK(cancel());
            return fail(ErrorCode::interrupted, "interrupted");
        }
    }
    return finish();
}

uint32_t Denoiser::frames() const
{
    return memory_->frames;
}

} // namespace semrover
