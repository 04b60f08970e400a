// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kinds voxfield_transformer and voxfield_sampling
#include "engine/voxfield/token_sampler.h"
#include "tools/verify/golden_case.h"

#include <cmath>

namespace semrover {

namespace {

// cell indices from the centres of the cases: (index + 0.5) * voxel_size
std::vector<CellIndex> cells_of(const std::vector<float>& centers, size_t first, size_t count, float voxel_size)
{
    std::vector<CellIndex> cells(count);
    for (size_t i = 0; i < count; ++i)
        for (size_t a = 0; a < 3; ++a)
            cells[i][a] = int32_t(std::lround(centers[(first + i) * 3 + a] / voxel_size - 0.5f));
    return cells;
}

struct EvaluationInput {
    TokenSets sets;
    std::vector<uint32_t> mask;      // [M, words]
    std::vector<float> tokens;       // [M, C]
    std::vector<float> timesteps;    // [T]
    std::vector<uint32_t> table_row; // [2M]
    std::vector<float> condition;    // [M, W], or nothing
};

// The reference compares distances of centres that were rounded to float, up to 30 m from the origin: of two voxels 3 m
// apart some then lie beyond 3 m + 1e-6. Voxels of the product are integers (neighbor_mask); here the given centres
// decide.
std::vector<uint32_t> mask_of(const TokenSets& sets, const std::vector<float>& centers, float radius)
{
    const uint32_t words = divide_up(sets.longest, 32);
    std::vector<uint32_t> mask(size_t(sets.rows()) * words, 0);
    for (uint32_t r = 0; r < sets.rows(); ++r)
        for (uint32_t j = 0; j < sets.sets[2 * r + 1]; ++j) {
            const uint32_t other = sets.sets[2 * r] + j;
            double squared = 0;
            for (uint32_t a = 0; a < 3; ++a) {
                const double d = double(centers[3 * r + a]) - double(centers[3 * other + a]);
                squared += d * d;
            }
            if (std::sqrt(squared) <= double(radius) + 1e-6)
                mask[size_t(r) * words + j / 32] |= 1u << j % 32;
        }
    return mask;
}

Result<std::vector<float>> evaluate(Device& device, const Transformer& t, const EvaluationInput& in)
{
    const uint32_t m = in.sets.rows(), c = t.config().channels(), d = t.config().dim(),
                   words = divide_up(in.sets.longest, 32);
    const uint32_t times = uint32_t(in.timesteps.size());
    TensorPool state;
    const auto array = [&](uint32_t rows, uint32_t width, DType dtype, const char* name) {
        return state.tensor(rows, width, dtype, name, width);
    };
    const DeviceTensor labels = array(m, 1, DType::u32, "labels"), cells = array(m, 4, DType::i32, "cells"),
                       sets = array(m, 2, DType::u32, "sets"), coords = array(m, 3, DType::f32, "coords"),
                       tiles = array(uint32_t(in.sets.tiles.size() / 4), 4, DType::u32, "tiles"),
                       mask = array(m, words, DType::u32, "mask"), rows = array(2 * m, 1, DType::u32, "table_row"),
                       timesteps = array(times, 1, DType::f32, "timesteps"),
                       pos = state.tensor(m, d, t.precision(), "pos"),
                       tokens = state.tensor(m, c, t.precision(), "tokens"),
                       modulations = state.tensor(times, t.modulation_width(), DType::f32, "modulations"),
                       out = state.tensor(m, c, DType::f32, "out");
    DeviceTensor condition, conditioning, voxel_conditioning;
    if (!in.condition.empty()) {
        condition = state.tensor(m, t.config().condition_width(), t.precision(), "condition");
        conditioning = state.tensor(m, d, t.precision(), "conditioning");
        if (t.config().condition_voxels)
            voxel_conditioning = state.tensor(m, d, t.precision(), "voxel conditioning");
    }
    SR_CHECK(state.allocate(device, "golden case"));
    SR_CHECK(labels.write(device, in.sets.labels));
    SR_CHECK(cells.write(device, in.sets.cells));
    SR_CHECK(sets.write(device, in.sets.sets));
    SR_CHECK(tiles.write(device, in.sets.tiles));
    SR_CHECK(coords.write(device, in.sets.coords));
    SR_CHECK(mask.write(device, in.mask));
    SR_CHECK(rows.write(device, in.table_row));
    SR_CHECK(timesteps.write(device, in.timesteps));
    SR_CHECK(tokens.write_rows(device, in.tokens));
    if (condition.valid())
        SR_CHECK(condition.write_rows(device, in.condition));

    Graph g(device.limits());
    TokenContext context{labels.in(g), cells.in(g),    sets.in(g),         tiles.in(g),
                         coords.in(g), pos.in(g),      conditioning.in(g), voxel_conditioning.in(g),
                         mask.in(g),   in.sets.longest};
    const Tensor positions = t.positions(g, context);
    g.keep(positions, pos);
    if (conditioning.valid()) {
        const Conditioned made = t.condition(g, positions, condition.in(g));
        g.keep(made.semantic, conditioning);
        if (voxel_conditioning.valid())
            g.keep(made.voxels, voxel_conditioning);
    }
    t.modulations(g, timesteps.in(g), modulations.in(g));
    g.keep(t.forward(g, tokens.in(g), context, modulations.in(g), rows.in(g)), out);
    SR_TRY(const auto executable, Executable::create(device, g));
    SR_CHECK(executable->run());
    return out.read_rows(device, m);
}

} // namespace

Result<GoldenOutputs> run_voxfield_transformer(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const auto transformer, Transformer::load(device, c.model(), precision));
    const auto tokens = c.floats("input.tokens"), centers = c.floats("input.centers"),
               times = c.floats("input.timestep"),
               conditioning = c.floats("input.condition"); // of models with one
    const auto labels = c.integers("input.labels"), valid = c.integers("input.valid");
    const auto shape = c.shape("input.tokens"); // [B, N, C]
    if (shape.size() != 3 || shape[2] != transformer->config().channels() || valid.size() != shape[0] * shape[1] ||
        labels.size() != valid.size() || centers.size() != 3 * valid.size() || times.size() != shape[0])
        return fail(ErrorCode::bad_input, "{}: inputs do not belong together", c.name());
    const size_t n = shape[1], channels = shape[2], width = transformer->config().condition_width();
    if (conditioning.size() != valid.size() * width)
        return fail(ErrorCode::bad_input, "{}: input.condition has {} numbers, expected {}", c.name(),
                    conditioning.size(), valid.size() * width);
    EvaluationInput in;
    in.timesteps = times;
    std::vector<float> packed_centers;
    std::vector<size_t> source; // row of the case for each packed row
    for (size_t b = 0; b < shape[0]; ++b) {
        std::vector<CellIndex> cells;
        std::vector<uint32_t> set_labels;
        for (size_t i = b * n; i < (b + 1) * n; ++i) {
            if (!valid[i])
                continue;
            cells.push_back(cells_of(centers, i, 1, transformer->config().voxel_size)[0]);
            set_labels.push_back(uint32_t(labels[i]));
            in.tokens.insert(in.tokens.end(), &tokens[i * channels], &tokens[i * channels] + channels);
            in.condition.insert(in.condition.end(), conditioning.begin() + ptrdiff_t(i * width),
                                conditioning.begin() + ptrdiff_t((i + 1) * width));
            packed_centers.insert(packed_centers.end(), &centers[3 * i], &centers[3 * i] + 3);
            in.table_row.push_back(uint32_t(b));
            source.push_back(i);
        }
        in.sets.add(cells, set_labels);
    }
    in.sets.pad(transformer->config().num_classes);
    in.tokens.resize(in.sets.rows() * channels);
    in.table_row.resize(in.sets.rows());
    packed_centers.resize(3 * in.sets.rows());
    in.mask = mask_of(in.sets, packed_centers, transformer->config().attention_radius);
    in.table_row.insert(in.table_row.end(), in.table_row.begin(), in.table_row.begin() + in.sets.rows());
    SR_TRY(const std::vector<float> values, evaluate(device, *transformer, in));
    GoldenOutputs out;
    auto& sample = out.floats["sample"];
    auto& ignored = out.ignored["sample"];
    sample.assign(tokens.size(), 0.f);
    ignored.assign(tokens.size(), 1);
    for (size_t r = 0; r < source.size(); ++r)
        for (size_t k = 0; k < channels; ++k) {
            sample[source[r] * channels + k] = values[r * channels + k];
            ignored[source[r] * channels + k] = 0;
        }
    return out;
}

Result<GoldenOutputs> run_voxfield_sampling(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const auto transformer, Transformer::load(device, c.model(), precision));
    nlohmann::json scheduler = c.params();
    scheduler["_class_name"] = "DDPMScheduler";
    scheduler["prediction_type"] = "sample";
    scheduler.emplace("timestep_spacing", "leading");
    scheduler.emplace("variance_type", "fixed_small");
    std::vector<std::string> warnings;
    SR_TRY(const SchedulerConfig config, scheduler_config_from_json(scheduler, warnings));
    SR_TRY(const double steps, c.number("steps"));
    SR_TRY(const double guidance, c.number("guidance_scale"));
    RepaintOptions repaint;
    repaint.jump_length = c.params().value("jump_length", 0);
    repaint.jump_n_sample = std::max(1, c.params().value("jump_n_sample", 1));
    SR_TRY(const SamplingPlan plan, plan_sampling(config, int(steps), repaint));

    const auto labels = c.integers("input.labels"), mask = c.integers("input.known_mask");
    const auto first = c.floats("input.noise_initial"), noise = c.floats("input.noise"),
               fixed = c.floats("input.known_tokens");
    const size_t n = labels.size(), channels = transformer->config().channels();
    if (n == 0 || first.size() != n * channels || c.floats("input.centers").size() != 3 * n)
        return fail(ErrorCode::bad_input, "{}: inputs do not belong together", c.name());
    RegionInput region;
    region.cells = cells_of(c.floats("input.centers"), 0, n, transformer->config().voxel_size);
    region.labels.assign(labels.begin(), labels.end());
    region.known.assign(mask.begin(), mask.end());
    region.fixed = fixed;

    // normals in the order of the file: per step one for the targets, then, with known tokens, one for those
    size_t next = 0;
    const auto take = [&](std::span<float> out, bool known_rows) {
        for (size_t i = 0; i < n * channels && next + i < noise.size(); ++i)
            if (!known_rows || mask[i / channels])
                out[i] = noise[next + i];
        next += n * channels;
    };
    SamplerOptions options;
    options.guidance.scale = float(guidance);
    options.noise = [&](size_t row, std::span<float> out) {
        if (row == 0) {
            std::copy(first.begin(), first.end(), out.begin());
            return;
        }
        take(out, false);
        if (plan.rows[row - 1].kind == PlanRowKind::step && !mask.empty())
            take(out, true);
    };
    SR_TRY(const auto sampler, TokenSampler::create(device, *transformer, plan, std::move(options)));
    GoldenOutputs out;
    SR_TRY(out.floats["sample"], sampler->run({&region, 1}));
    if (next != noise.size())
        return fail(ErrorCode::bad_input, "{}: {} normals used of {}", c.name(), next, noise.size());
    return out;
}

} // namespace semrover
