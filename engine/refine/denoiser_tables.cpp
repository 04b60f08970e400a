// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/denoiser_tables.h"

#include <algorithm>

namespace semrover {

DenoiserTables::DenoiserTables(State& state, const Unet& unet, const SamplingPlan& plan, uint32_t rows_before,
                               uint32_t text_tokens)
    : first_rows(rows_before), tokens(text_tokens)
{
    constexpr uint32_t kWords = sizeof(StepRow) / 4;
    const uint32_t count = uint32_t(plan.timesteps.size()), numbers = unet.config().added_numbers;
    steps = state.slot(uint32_t(plan.rows.size()) + first_rows, kWords, DType::u32, "steps", kWords);
    clock = ReplayMemory::clock_slot(state);
    timesteps_ = state.slot(count, 1, DType::f32, "timesteps", 1);
    times = state.slot(count, unet.time_width(), DType::f32, "times");
    if (numbers)
        added_ = state.slot(count, numbers, DType::f32, "added numbers", numbers);
    if (const uint32_t rows = round_up(tokens, kImageRowPadding); rows && unet.context_width()) {
        context_ = state.slot(rows, unet.config().cross_attention_dim, unet.precision(), "conditioning");
        text = state.slot(rows, unet.context_width(), unet.precision(), "text");
    }
}

void DenoiserTables::add(Graph& g, const Unet& unet) const
{
    g.keep(unet.time_table(g, timesteps_.in(g), {}, added_.in(g)), times);
    if (text.valid())
        g.keep(unet.context_table(g, context_.in(g)), text);
}

Status DenoiserTables::write(Device& device, const SamplingPlan& plan, std::span<const StepRow> before,
                             const VideoConditioning& conditioning) const
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
    const std::span<const float> values = conditioning.text.values;
    SR_ASSERT(values.size() == size_t(tokens) * context_.cols(), "{} numbers of conditioning for {} tokens of {}",
              values.size(), tokens, context_.cols());
    return context_.write_rows(device, values);
}

} // namespace semrover
