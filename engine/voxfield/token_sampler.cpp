// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/token_sampler.h"

#include <cmath>

namespace semrover {

struct TokenSampler::Batch {
    uint32_t rows, tiles, longest; // rows: of one guidance half
    TensorPool state;
    DeviceTensor labels, cells, sets, tile_list, coords, pos, mask, known, fixed, x, x0, z,
        table_row;                                            // z: noise that is given
    DeviceTensor condition, conditioning, voxel_conditioning; // none where the model takes labels alone
    DeviceTensor points;
    std::unique_ptr<Executable> prepare, step, unguided, undo,
        decode; // unguided: of the first half, where steps differ

    Batch(const TokenSampler& s, const TokenSets& packed)
        : rows(packed.rows() / s.halves_), tiles(uint32_t(packed.tiles.size() / 4)), longest(packed.longest)
    {
        const Transformer& t = s.transformer_;
        const uint32_t m = packed.rows(), channels = t.config().channels(), words = divide_up(longest, 32);
        labels = state.tensor(m, 1, DType::u32, "labels", 1);
        cells = state.tensor(m, 4, DType::i32, "cells", 4);
        sets = state.tensor(m, 2, DType::u32, "sets", 2);
        tile_list = state.tensor(tiles, 4, DType::u32, "tiles", 4);
        coords = state.tensor(m, 3, DType::f32, "coords", 3);
        pos = state.tensor(m, t.config().dim(), t.precision(), "pos");
        mask = state.tensor(m, words, DType::u32, "mask", words);
        known = state.tensor(rows, 1, DType::u32, "known", 1);
        fixed = state.tensor(rows, channels, DType::f32, "fixed");
        x = state.tensor(rows, channels, DType::f32, "x");
        x0 = state.tensor(rows, channels, DType::f32, "x0");
        if (const uint32_t width = t.config().condition_width()) {
            condition = state.tensor(m, width, t.precision(), "condition");
            conditioning = state.tensor(m, t.config().dim(), t.precision(), "conditioning");
        }
        if (t.config().condition_voxels)
            voxel_conditioning = state.tensor(m, t.config().dim(), t.precision(), "voxel conditioning");
        if (s.options_.noise)
            z = state.tensor(rows, channels, DType::f32, "z");
        table_row = state.tensor(2 * m, 1, DType::u32, "table_row", 1);
        points = state.tensor(rows, channels / 2, DType::u32, "points", channels / 2);
    }
    // of both halves, or of the first one
    TokenContext context(Graph& g, uint32_t halves) const
    {
        const uint32_t m = rows * halves, all = labels.rows();
        TokenContext c;
        c.labels = labels.row_range(0, m).in(g);
        c.cells = cells.row_range(0, m).in(g);
        c.sets = sets.row_range(0, m).in(g);
        c.tiles = tile_list.row_range(0, tiles * m / all).in(g);
        c.coords = coords.row_range(0, m).in(g);
        c.pos = pos.row_range(0, m).in(g);
        if (conditioning.valid())
            c.conditioning = conditioning.row_range(0, m).in(g);
        if (voxel_conditioning.valid())
            c.voxel_conditioning = voxel_conditioning.row_range(0, m).in(g);
        c.mask = mask.row_range(0, m).in(g);
        c.longest = longest;
        return c;
    }
    Graph prepare_graph(const TokenSampler& s) const
    {
        Graph g(s.device_.limits());
        const Transformer& t = s.transformer_;
        const TokenContext c = context(g, s.halves_);
        g.keep(t.neighbors(g, c, rows, s.options_.guidance.radius), mask);
        const Tensor positions = t.positions(g, c);
        g.keep(positions, pos);
        if (!conditioning.valid())
            return g;
        const Conditioned made = t.condition(g, positions, condition.in(g));
        g.keep(made.semantic, conditioning);
        if (made.voxels.valid())
            g.keep(made.voxels, voxel_conditioning);
        return g;
    }
    Tensor noise(Graph& g, const TokenSampler& s, const StepTable& steps) const
    {
        if (z.valid())
            return z.in(g);
        return step_noise(g, steps, cells.row_range(0, rows).in(g), known.in(g), s.transformer_.config().channels(),
                          s.options_.seed);
    }
    Graph step_graph(const TokenSampler& s, uint32_t halves) const
    {
        Graph g(s.device_.limits());
        const Transformer& t = s.transformer_;
        const StepTable steps = s.step_table(g);
        const Tensor state_x = x.in(g), current = table_row.row_range(0, 2 * rows * halves).in(g);
        step_timestep(g, steps, current);
        const Tensor in = step_input(g, steps, state_x, rows * halves, t.precision());
        const Tensor m = t.forward(g, in, context(g, halves), s.table_.in(g), current);
        step_update(g, steps, m, noise(g, s, steps), known.in(g), fixed.in(g), state_x, x0.in(g),
                    s.options_.guidance.scale, float(s.plan_.clip));
        step_advance(g, steps.clock);
        return g;
    }
    Graph undo_graph(const TokenSampler& s) const
    {
        Graph g(s.device_.limits());
        const StepTable steps = s.step_table(g);
        step_renoise(g, steps, noise(g, s, steps), x.in(g));
        if (s.plan_.known == KnownTokens::clean)
            step_hold(g, known.in(g), fixed.in(g), x.in(g));
        step_advance(g, steps.clock);
        return g;
    }
    Graph decode_graph(const TokenSampler& s) const
    {
        Graph g(s.device_.limits());
        g.keep(decode_tokens(g, x.in(g), s.normalization_.in(g), s.transformer_.config().voxel_size / 2), points);
        return g;
    }
};

TokenSampler::~TokenSampler() = default;

TokenSampler::TokenSampler(Device& device, const Transformer& transformer, const SamplingPlan& plan,
                           SamplerOptions options)
    : StepLoop(device, plan.rows.size() + 1, [this](size_t row) { return executable_of(row); }),
      transformer_(transformer), plan_(plan), options_(std::move(options)), halves_(1),
      window_(uint32_t(std::min<size_t>(options_.modulation_window, plan.timesteps.size())))
{
    for (const PlanRow& row : plan_.rows) {
        if (row.kind != PlanRowKind::step)
            continue;
        if (guided(row))
            halves_ = 2;
        else
            ++unguided_steps_;
    }
    constexpr uint32_t kWords = sizeof(StepRow) / 4;
    steps_ = state_.tensor(uint32_t(plan.rows.size()) + 1, kWords, DType::u32, "steps", kWords);
    clock_ = StepMemory::clock_tensor(state_);
    timesteps_ = state_.tensor(window_, 1, DType::f32, "timesteps", 1);
    table_ = state_.tensor(window_, transformer.modulation_width(), DType::f32, "modulations");
    normalization_ = state_.tensor(2, 6, DType::f32, "normalization", 6);
}

Result<std::unique_ptr<TokenSampler>> TokenSampler::create(Device& device, const Transformer& transformer,
                                                           const SamplingPlan& plan, SamplerOptions options)
{
    const Guidance& guidance = options.guidance;
    SR_CHECK(check_guidance(guidance.scale));
    if (!(guidance.from >= 0))
        return fail(ErrorCode::usage, "guidance from timestep {}, which is below 0", guidance.from);
    if (!(guidance.until >= guidance.from))
        return fail(ErrorCode::usage, "guidance until timestep {}, which is below {}, from where it begins",
                    guidance.until, guidance.from);
    if (!(guidance.radius >= 0))
        return fail(ErrorCode::usage, "guidance radius {}, which is below 0", guidance.radius);
    std::unique_ptr<TokenSampler> s(new TokenSampler(device, transformer, plan, std::move(options)));
    SR_CHECK(s->state_.allocate(device, "sampler tables"));
    SR_CHECK(s->upload_steps());
    SR_CHECK(s->upload_normalization());
    SR_CHECK(s->make_modulations());
    return s;
}

bool TokenSampler::guided(const PlanRow& step) const
{
    return options_.guidance.at(step.coefficients.timestep);
}

// row 0 is the first noise, x = init_noise_sigma * z; the plan's rows follow
Status TokenSampler::upload_steps()
{
    std::vector<StepRow> rows{first_noise_row(plan_.init_noise_sigma, kFirstDraw)};
    for (const PlanRow& row : plan_.rows)
        rows.push_back(step_row(row));
    SR_CHECK(clock_.clear(device_));
    return steps_.write(device_, rows);
}

// of a model without it: what leaves every number as it is, -0 too
Status TokenSampler::upload_normalization()
{
    const auto& given = transformer_.config().normalization;
    std::array<float, 12> values;
    for (size_t c = 0; c < 6; ++c) {
        values[c] = given ? given->mean[c] : -0.f;
        values[6 + c] = given ? given->std[c] : 1.f;
    }
    return normalization_.write(device_, values);
}

Status TokenSampler::make_modulations()
{
    Graph g(device_.limits());
    transformer_.modulations(g, timesteps_.in(g), table_.in(g));
    SR_TRY(modulations_, Executable::create(device_, g));
    return {};
}

StepTable TokenSampler::step_table(Graph& g) const
{
    return {steps_.in(g), clock_.in(g)};
}

// each half is padded to kRowAlignment rows
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
    auto b = std::make_unique<Batch>(*this, sets);
    SR_CHECK(b->state.allocate(device_, "sampler state"));
    SR_TRY(b->prepare, Executable::create(device_, b->prepare_graph(*this)));
    SR_TRY(b->step, Executable::create(device_, b->step_graph(*this, halves_)));
    if (halves_ == 2 && unguided_steps_) {
        SR_TRY(b->unguided, Executable::create(device_, b->step_graph(*this, 1)));
    }
    SR_TRY(b->undo, Executable::create(device_, b->undo_graph(*this)));
    SR_TRY(b->decode, Executable::create(device_, b->decode_graph(*this)));
    batch_ = std::move(b);
    return batch_.get();
}

Result<uint64_t> TokenSampler::planned_bytes(uint32_t regions, uint32_t cells) const
{
    RegionInput region;
    for (uint32_t i = 0; i < cells; ++i)
        region.cells.push_back({int32_t(i), 0, 0});
    region.labels.assign(cells, 0);
    const Batch b(*this, pack(std::vector<RegionInput>(regions, region)));
    uint64_t bytes = table_bytes() + b.state.planned_bytes(device_.limits());
    std::vector<Graph> graphs;
    graphs.push_back(b.prepare_graph(*this));
    graphs.push_back(b.step_graph(*this, halves_));
    graphs.push_back(b.undo_graph(*this));
    graphs.push_back(b.decode_graph(*this));
    if (halves_ == 2 && unguided_steps_)
        graphs.push_back(b.step_graph(*this, 1));
    for (const Graph& g : graphs) {
        SR_TRY(const Plan plan, make_plan(g));
        bytes += plan.arena_bytes();
    }
    return bytes;
}

uint64_t TokenSampler::table_bytes() const
{
    return state_.planned_bytes(device_.limits()) + modulations_->plan().arena_bytes();
}

// of the half with labels; that without is unconditioned
std::vector<float> TokenSampler::conditions(uint32_t rows, std::span<const RegionInput> regions) const
{
    const size_t width = transformer_.config().condition_width();
    std::vector<float> all(rows * width, 0.f);
    size_t row = 0;
    for (const RegionInput& r : regions) {
        SR_ASSERT(r.condition.empty() || r.condition.size() == r.cells.size() * width, "{} numbers condition {} voxels",
                  r.condition.size(), r.cells.size());
        std::ranges::copy(r.condition, all.begin() + ptrdiff_t(row * width));
        row += r.cells.size();
    }
    return all;
}

Status TokenSampler::upload(Batch& b, const TokenSets& sets, std::span<const RegionInput> regions)
{
    SR_CHECK(b.labels.write(device_, sets.labels));
    SR_CHECK(b.cells.write(device_, sets.cells));
    SR_CHECK(b.sets.write(device_, sets.sets));
    SR_CHECK(b.tile_list.write(device_, sets.tiles));
    SR_CHECK(b.coords.write(device_, sets.coords));
    const size_t channels = transformer_.config().channels();
    std::vector<uint32_t> known(b.rows, 0);
    std::vector<float> fixed(b.rows * channels, 0.f);
    size_t row = 0;
    for (const RegionInput& r : regions)
        for (size_t i = 0; i < r.cells.size(); ++i, ++row) {
            known[row] = r.known.empty() ? 0 : r.known[i];
            if (known[row])
                std::copy_n(&r.fixed[i * channels], channels, &fixed[row * channels]);
        }
    SR_CHECK(b.known.write(device_, known));
    SR_CHECK(b.fixed.write_rows(device_, fixed));
    return b.condition.valid() ? b.condition.write_rows(device_, conditions(b.rows, regions)) : Status();
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
    SR_CHECK(timesteps_.write(device_, timesteps));
    SR_CHECK(modulations_->run());
    first_timestep_ = first;
    const BufferSlice word = clock_.slice().part(offsetof(StepClock, first_timestep), 4);
    return device_.write(word, std::as_bytes(std::span(&first, 1)));
}

Status TokenSampler::feed_noise(Batch& b, size_t row)
{
    if (!options_.noise)
        return {};
    std::vector<float> normals(size_t(b.rows) * transformer_.config().channels());
    options_.noise(row, normals);
    return b.z.write_rows(device_, normals);
}

// row 0 is the first noise
Result<Executable*> TokenSampler::executable_of(size_t row)
{
    const bool step = row > 0 && plan_.rows[row - 1].kind == PlanRowKind::step;
    if (step)
        SR_CHECK(use_timestep(plan_.rows[row - 1].timestep_index));
    SR_CHECK(feed_noise(*batch_, row));
    if (!step)
        return batch_->undo.get();
    return batch_->unguided && !guided(plan_.rows[row - 1]) ? batch_->unguided.get() : batch_->step.get();
}

Status TokenSampler::begin(std::span<const RegionInput> regions)
{
    const TokenSets sets = pack(regions);
    SR_CHECK(cancel());
    SR_TRY(Batch * b, batch_for(sets));
    tokens_ = 0;
    for (const RegionInput& r : regions)
        tokens_ += uint32_t(r.cells.size());
    SR_CHECK(upload(*b, sets, regions));
    SR_CHECK(b->prepare->run());
    return StepLoop::begin({clock_, b->x, b->x0});
}

// errors: internal for numbers that are not finite
Result<std::vector<float>> TokenSampler::read_tokens() const
{
    const size_t channels = transformer_.config().channels();
    SR_TRY(std::vector<float> tokens, batch_->x.read_rows(device_, tokens_));
    for (size_t i = 0; i < tokens.size(); ++i)
        if (!std::isfinite(tokens[i]))
            return fail(ErrorCode::internal,
                        "the network returned {} for channel {} of token {}: overflow; try `precision` fp32", tokens[i],
                        i % channels, i / channels);
    return tokens;
}

Result<std::vector<float>> TokenSampler::finish()
{
    end();
    return read_tokens();
}

Result<std::vector<uint32_t>> TokenSampler::finish_points()
{
    end();
    SR_CHECK(batch_->decode->run());
    SR_TRY(std::vector<uint32_t> words, batch_->points.row_range(0, tokens_).read<uint32_t>(device_));
    for (size_t i = 1; i < words.size(); i += 3)
        if (words[i] >> 31)
            SR_CHECK(read_tokens().map([](const auto&) {}));
    return words;
}

Result<std::vector<float>> TokenSampler::run(std::span<const RegionInput> regions)
{
    SR_CHECK(begin(regions));
    SR_CHECK(step(rows()).map([](bool) {}));
    return finish();
}

const Executable& TokenSampler::step_executable() const
{
    return *batch_->step;
}

} // namespace semrover
