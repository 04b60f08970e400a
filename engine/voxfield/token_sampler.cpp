// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/token_sampler.h"

#include "engine/sampling/step_rows.h"

#include <cmath>
#include <cstring>
#include <deque>

namespace semrover {

namespace {

constexpr size_t kInFlight = 3; // submits ahead of the device

} // namespace

struct TokenSampler::Batch {
    uint32_t rows = 0, tiles = 0, longest = 0; // rows: of one guidance half
    Arena arena;
    uint32_t labels, cells, sets, tile_list, coords, pos, mask, known, fixed, x, x0, z, table_row;
    std::unique_ptr<Program> prepare, step, undo;

    void lay_out(const Transformer& t, uint32_t halves)
    {
        const uint64_t m = uint64_t(rows) * halves, c = round_up(t.config().channels(), kRowPadding) * 4ull;
        labels = arena.add(m * 4);
        cells = arena.add(m * 16);
        sets = arena.add(m * 8);
        tile_list = arena.add(tiles * 16ull);
        coords = arena.add(m * 12);
        pos = arena.add(m * round_up(t.config().dim(), kRowPadding) * dtype_bytes(t.precision()));
        mask = arena.add(m * divide_up(longest, 32) * 4);
        known = arena.add(rows * 4ull);
        fixed = arena.add(rows * c);
        x = arena.add(rows * c);
        x0 = arena.add(rows * c);
        z = arena.add(rows * c);
        table_row = arena.add(2 * m * 4);
    }
    TokenContext context(Graph& g, const Transformer& t, uint32_t halves) const
    {
        const uint32_t m = rows * halves;
        TokenContext c;
        c.labels = g.external(arena.slice(labels), m, 1, DType::u32, "labels", 1);
        c.cells = g.external(arena.slice(cells), m, 4, DType::i32, "cells", 4);
        c.sets = g.external(arena.slice(sets), m, 2, DType::u32, "sets", 2);
        c.tiles = g.external(arena.slice(tile_list), tiles, 4, DType::u32, "tiles", 4);
        c.coords = g.external(arena.slice(coords), m, 3, DType::f32, "coords", 3);
        c.pos = g.external(arena.slice(pos), m, t.config().dim(), t.precision(), "pos");
        c.mask = g.external(arena.slice(mask), m, divide_up(longest, 32), DType::u32, "mask", divide_up(longest, 32));
        c.longest = longest;
        return c;
    }
    Tensor state(Graph& g, const Transformer& t, uint32_t id, const char* name) const
    {
        return g.external(arena.slice(id), rows, t.config().channels(), DType::f32, name);
    }
    Graph prepare_graph(const Transformer& t, uint32_t halves) const
    {
        Graph g;
        t.prepare(g, context(g, t, halves));
        return g;
    }
    Tensor noise(Graph& g, const TokenSampler& s, const StepTable& steps, const TokenContext& c,
                 Tensor known_rows) const
    {
        if (s.options_.noise)
            return state(g, s.transformer_, z, "z");
        return step_noise(g, steps, c.cells.row_range(0, rows), known_rows, s.transformer_.config().channels(),
                          s.options_.seed);
    }
    Graph step_graph(const TokenSampler& s) const
    {
        Graph g;
        const Transformer& t = s.transformer_;
        StepTable steps;
        Tensor table;
        s.add_tables(g, steps, table);
        const TokenContext c = context(g, t, s.halves_);
        const Tensor known_rows = g.external(arena.slice(known), rows, 1, DType::u32, "known", 1);
        const Tensor current = g.external(arena.slice(table_row), 2 * rows * s.halves_, 1, DType::u32, "table_row", 1);
        const Tensor state_x = state(g, t, x, "x");
        step_timestep(g, steps, current);
        const Tensor in = step_input(g, steps, state_x, rows * s.halves_, t.precision());
        const Tensor m = t.forward(g, in, c, table, current);
        step_update(g, steps, m, noise(g, s, steps, c, known_rows), known_rows, state(g, t, fixed, "fixed"), state_x,
                    state(g, t, x0, "x0"), s.options_.guidance_scale, float(s.plan_.clip));
        step_advance(g, steps.clock);
        return g;
    }
    Graph undo_graph(const TokenSampler& s) const
    {
        Graph g;
        StepTable steps;
        Tensor table;
        s.add_tables(g, steps, table);
        const TokenContext c = context(g, s.transformer_, s.halves_);
        const Tensor known_rows = g.external(arena.slice(known), rows, 1, DType::u32, "known", 1);
        const Tensor state_x = state(g, s.transformer_, x, "x");
        step_renoise(g, steps, noise(g, s, steps, c, known_rows), state_x);
        if (s.plan_.known == KnownTokens::clean)
            step_hold(g, known_rows, state(g, s.transformer_, fixed, "fixed"), state_x);
        step_advance(g, steps.clock);
        return g;
    }
};

TokenSampler::~TokenSampler() = default;

TokenSampler::TokenSampler(Device& device, const Transformer& transformer, const SamplingPlan& plan,
                           SamplerOptions options)
    : device_(device), transformer_(transformer), plan_(plan), options_(std::move(options)),
      halves_(options_.guidance_scale == 1.f ? 1 : 2),
      window_(uint32_t(std::min<size_t>(options_.modulation_window, plan.timesteps.size())))
{
    steps_ = arena_.add((plan.rows.size() + 1) * sizeof(StepRow));
    clock_ = arena_.add(sizeof(StepClock));
    timesteps_ = arena_.add(window_ * 4);
    table_ = arena_.add(uint64_t(window_) * round_up(transformer.modulation_width(), kRowPadding) * 4);
}

Result<std::unique_ptr<TokenSampler>> TokenSampler::create(Device& device, const Transformer& transformer,
                                                           const SamplingPlan& plan, SamplerOptions options)
{
    if (!(options.guidance_scale >= 0 && options.guidance_scale <= 1000))
        return fail(ErrorCode::usage, "guidance scale {} is not in 0..1000", options.guidance_scale);
    std::unique_ptr<TokenSampler> s(new TokenSampler(device, transformer, plan, std::move(options)));
    SR_CHECK(s->arena_.allocate(device, "sampler tables"));
    SR_CHECK(s->upload_steps());
    SR_CHECK(s->make_modulations());
    return s;
}

// row 0 is the first noise, x = init_noise_sigma * z; the plan's rows follow
Status TokenSampler::upload_steps()
{
    std::vector<StepRow> rows{first_noise_row(plan_.init_noise_sigma, kFirstDraw)};
    for (const PlanRow& row : plan_.rows)
        rows.push_back(step_row(row));
    return device_.write(arena_.slice(steps_), std::as_bytes(std::span(rows)));
}

Status TokenSampler::make_modulations()
{
    Graph g;
    const Tensor timesteps = g.external(arena_.slice(timesteps_), window_, 1, DType::f32, "timesteps", 1);
    const Tensor table =
        g.external(arena_.slice(table_), window_, transformer_.modulation_width(), DType::f32, "modulations");
    transformer_.modulations(g, timesteps, table);
    SR_TRY(modulations_, Program::create(device_, g));
    return {};
}

void TokenSampler::add_tables(Graph& g, StepTable& steps, Tensor& table) const
{
    constexpr uint32_t kWords = sizeof(StepRow) / 4;
    steps.rows = g.external(arena_.slice(steps_), uint32_t(plan_.rows.size()) + 1, kWords, DType::u32, "steps", kWords);
    steps.clock = g.external(arena_.slice(clock_), 1, 2, DType::u32, "clock", 2);
    table = g.external(arena_.slice(table_), window_, transformer_.modulation_width(), DType::f32, "modulations");
}

// each half is padded with sets of one cell to kRowAlignment rows
TokenSets TokenSampler::pack(std::span<const RegionInput> regions) const
{
    TokenSets sets;
    const uint32_t null_label = transformer_.config().num_classes;
    for (uint32_t half = 0; half < halves_; ++half) {
        for (const RegionInput& r : regions)
            sets.add(r.cells, half == 0 ? r.labels : std::vector<uint32_t>(r.cells.size(), null_label));
        sets.pad(null_label);
    }
    return sets;
}

Result<TokenSampler::Batch*> TokenSampler::batch_for(const TokenSets& sets)
{
    const uint32_t rows = sets.rows() / halves_, tiles = uint32_t(sets.tiles.size() / 4);
    if (batch_ && batch_->rows == rows && batch_->tiles == tiles && batch_->longest == sets.longest)
        return batch_.get();
    batch_.reset(); // memory of the old shape goes before the new one's comes
    auto b = std::make_unique<Batch>();
    b->rows = rows;
    b->tiles = tiles;
    b->longest = sets.longest;
    b->lay_out(transformer_, halves_);
    SR_CHECK(b->arena.allocate(device_, "sampler state"));
    SR_TRY(b->prepare, Program::create(device_, b->prepare_graph(transformer_, halves_)));
    SR_TRY(b->step, Program::create(device_, b->step_graph(*this)));
    SR_TRY(b->undo, Program::create(device_, b->undo_graph(*this)));
    batch_ = std::move(b);
    return batch_.get();
}

Result<uint64_t> TokenSampler::planned_bytes(uint32_t regions, uint32_t cells) const
{
    RegionInput region;
    for (uint32_t i = 0; i < cells; ++i)
        region.cells.push_back({int32_t(i), 0, 0});
    region.labels.assign(cells, 0);
    const TokenSets sets = pack(std::vector<RegionInput>(regions, region));
    Batch b;
    b.rows = sets.rows() / halves_;
    b.tiles = uint32_t(sets.tiles.size() / 4);
    b.longest = sets.longest;
    b.lay_out(transformer_, halves_);
    uint64_t bytes = table_bytes() + b.arena.planned_bytes(device_.limits());
    for (const Graph& g : {b.prepare_graph(transformer_, halves_), b.step_graph(*this), b.undo_graph(*this)}) {
        SR_TRY(const Plan plan, make_plan(g.desc(), device_.limits()));
        bytes += plan.arena_bytes();
    }
    return bytes;
}

uint64_t TokenSampler::table_bytes() const
{
    return arena_.planned_bytes(device_.limits()) + modulations_->plan().arena_bytes();
}

Status TokenSampler::upload(Batch& b, const TokenSets& sets, std::span<const RegionInput> regions)
{
    const auto write = [&](uint32_t id, const auto& values) {
        return device_.write(b.arena.slice(id), std::as_bytes(std::span(values)));
    };
    SR_CHECK(write(b.labels, sets.labels));
    SR_CHECK(write(b.cells, sets.cells));
    SR_CHECK(write(b.sets, sets.sets));
    SR_CHECK(write(b.tile_list, sets.tiles));
    SR_CHECK(write(b.coords, sets.coords));
    const size_t channels = transformer_.config().channels(), ld = round_up(uint32_t(channels), kRowPadding);
    std::vector<uint32_t> known(b.rows, 0);
    std::vector<float> fixed(b.rows * ld, 0.f);
    size_t row = 0;
    for (const RegionInput& r : regions)
        for (size_t i = 0; i < r.cells.size(); ++i, ++row) {
            known[row] = r.known.empty() ? 0 : r.known[i];
            if (known[row])
                std::copy_n(&r.fixed[i * channels], channels, &fixed[row * ld]);
        }
    SR_CHECK(write(b.known, known));
    SR_CHECK(write(b.fixed, fixed));
    SR_CHECK(device_.clear(b.arena.slice(b.x)));
    SR_CHECK(device_.clear(b.arena.slice(b.x0)));
    const StepClock clock{0, first_timestep_ == ~0u ? 0 : first_timestep_};
    return device_.write(arena_.slice(clock_), std::as_bytes(std::span(&clock, 1)));
}

// the modulation table holds a window of the schedule's timesteps; jumps may leave it either way
Status TokenSampler::use_timestep(uint32_t index)
{
    const uint32_t first = index / window_ * window_;
    if (first == first_timestep_)
        return {};
    std::vector<float> timesteps(window_);
    for (uint32_t i = 0; i < window_; ++i)
        timesteps[i] = float(plan_.timesteps[std::min<size_t>(first + i, plan_.timesteps.size() - 1)]);
    SR_CHECK(device_.write(arena_.slice(timesteps_), std::as_bytes(std::span(timesteps))));
    SR_CHECK(modulations_->run());
    first_timestep_ = first;
    const BufferSlice word = arena_.slice(clock_).part(offsetof(StepClock, first_timestep), 4);
    return device_.write(word, std::as_bytes(std::span(&first, 1)));
}

Status TokenSampler::feed_noise(Batch& b, size_t row)
{
    if (!options_.noise)
        return {};
    const size_t channels = transformer_.config().channels(), ld = round_up(uint32_t(channels), kRowPadding);
    std::vector<float> normals(b.rows * channels), padded(b.rows * ld, 0.f);
    options_.noise(row, normals);
    for (size_t r = 0; r < b.rows; ++r)
        std::copy_n(&normals[r * channels], channels, &padded[r * ld]);
    return device_.write(b.arena.slice(b.z), std::as_bytes(std::span(padded)));
}

Status TokenSampler::run_rows(Batch& b, const StepCallback& callback)
{
    std::deque<uint64_t> flight;
    const size_t total = plan_.rows.size() + 1;
    for (size_t row = 0; row < total; ++row) {
        const bool step = row > 0 && plan_.rows[row - 1].kind == PlanRowKind::step;
        if (step)
            SR_CHECK(use_timestep(plan_.rows[row - 1].timestep_index));
        SR_CHECK(feed_noise(b, row));
        Program& program = step ? *b.step : *b.undo;
        SR_TRY(const uint64_t ticket, program.submit());
        flight.push_back(ticket);
        if (flight.size() > kInFlight || device_.profile() || options_.noise) {
            SR_CHECK(device_.wait(device_.profile() ? ticket : flight.front()));
            flight.pop_front();
            SR_CHECK(program.collect_profile());
        }
        if (callback && !callback(row + 1, total))
            return fail(ErrorCode::interrupted, "interrupted");
    }
    return device_.wait(device_.last_ticket());
}

Result<std::vector<float>> TokenSampler::run(std::span<const RegionInput> regions, const StepCallback& callback)
{
    const TokenSets sets = pack(regions);
    SR_TRY(Batch * b, batch_for(sets));
    SR_CHECK(upload(*b, sets, regions));
    SR_CHECK(b->prepare->run());
    SR_CHECK(run_rows(*b, callback));
    const size_t channels = transformer_.config().channels(), ld = round_up(uint32_t(channels), kRowPadding);
    std::vector<float> padded(b->rows * ld);
    SR_CHECK(device_.read(b->arena.slice(b->x), std::as_writable_bytes(std::span(padded))));
    std::vector<float> tokens;
    size_t row = 0;
    for (const RegionInput& r : regions)
        for (size_t i = 0; i < r.cells.size(); ++i, ++row)
            tokens.insert(tokens.end(), &padded[row * ld], &padded[row * ld] + channels);
    for (size_t i = 0; i < tokens.size(); ++i)
        if (!std::isfinite(tokens[i]))
            return fail(ErrorCode::internal,
                        "the network returned {} for channel {} of token {}: overflow; try --precision fp32", tokens[i],
                        i % channels, i / channels);
    return tokens;
}

uint32_t TokenSampler::step_passes() const
{
    return batch_ ? uint32_t(batch_->step->plan().passes.size()) : 0;
}
uint32_t TokenSampler::step_barriers() const
{
    return batch_ ? batch_->step->plan().barriers() : 0;
}
double TokenSampler::step_flops() const
{
    double flops = 0;
    for (const Pass& pass : batch_ ? batch_->step->plan().passes : std::vector<Pass>{})
        flops += pass.options.flops;
    return flops;
}
double TokenSampler::host_us_per_step() const
{
    return batch_ ? batch_->step->host_us() : 0;
}

} // namespace semrover
