// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/repaint.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace semrover {

namespace {

constexpr int kMaxJump = 10000;

// x' at the level of `to`, from x at the level of `from`, which is less noisy
StepCoefficients undo_step(const StepCoefficients& from, const StepCoefficients& to)
{
    StepCoefficients step;
    step.timestep = to.timestep;
    step.c_x = std::sqrt(to.abar / from.abar);
    step.c_z = std::sqrt(1 - to.abar / from.abar);
    step.abar = from.abar;
    return step;
}

} // namespace

Result<std::vector<int>> repaint_levels(int steps, const RepaintOptions& options)
{
    const int length = options.jump_length, count = options.jump_n_sample;
    if (steps < 1 || steps > kMaxInferenceSteps)
        return fail(ErrorCode::bad_input, "{} denoising steps, expected 1 to {}", steps, kMaxInferenceSteps);
    if (length < 0 || length > kMaxJump)
        return fail(ErrorCode::bad_input, "jump_length is {}, expected 0 to {}", length, kMaxJump);
    if (count < 1 || count > kMaxJump)
        return fail(ErrorCode::bad_input, "jump_n_sample is {}, expected 1 to {}", count, kMaxJump);
    // jumps start at levels 0, length, 2 length, ... below steps - length
    const int64_t starts = length == 0 || steps <= length ? 0 : (steps - 1) / length;
    const int64_t total = steps + starts * (count - 1) * 2 * length;
    if (total > int64_t(kMaxPlanRows))
        return fail(ErrorCode::bad_input, "{} steps with jump_length {} and jump_n_sample {} make {} rows, at most {}",
                    steps, length, count, total, kMaxPlanRows);
    std::vector<int> jumps_left(steps, 0);
    for (int64_t i = 0; i < starts; ++i)
        jumps_left[i * length] = count - 1;
    std::vector<int> levels;
    levels.reserve(total);
    for (int level = steps - 1; level >= 0; --level) {
        levels.push_back(level);
        if (jumps_left[level] == 0)
            continue;
        --jumps_left[level];
        for (int i = 0; i < length; ++i)
            levels.push_back(++level);
    }
    return levels;
}

Result<SamplingPlan> plan_sampling(const SchedulerConfig& config, int steps, const RepaintOptions& repaint)
{
    SR_TRY(const Schedule schedule, make_schedule(config, steps));
    SR_TRY(const std::vector<int> levels, repaint_levels(steps, repaint));
    if (!schedule.can_jump() && levels.size() > schedule.steps.size())
        return fail(ErrorCode::bad_input, "sampler {} cannot jump back, choose another or jump_n_sample 1",
                    sampler_name(schedule.sampler));
    SamplingPlan plan;
    plan.init_noise_sigma = schedule.init_noise_sigma;
    plan.clip = schedule.clip;
    plan.init_known_scale = schedule.init_known_scale;
    plan.known = repaint.known;
    std::map<double, uint32_t> index_of; // of a timestep
    PlanRowKind before = PlanRowKind::step;
    for (size_t i = 0; i < levels.size(); ++i) {
        const size_t at = size_t(steps - 1 - levels[i]); // levels count up from the end of the schedule
        PlanRow row;
        if (i > 0 && levels[i] > levels[i - 1]) {
            row.kind = PlanRowKind::undo;
            row.coefficients = undo_step(schedule.steps[at + 1], schedule.steps[at]);
        } else {
            row.coefficients = before == PlanRowKind::undo ? schedule.restarts[at] : schedule.steps[at];
            if (repaint.known == KnownTokens::clean) {
                row.coefficients.known_scale = 1;
                row.coefficients.known_noise = 0;
            }
            ++plan.evaluations;
        }
        before = row.kind;
        const auto [found, is_new] = index_of.emplace(row.coefficients.timestep, uint32_t(plan.timesteps.size()));
        if (is_new)
            plan.timesteps.push_back(row.coefficients.timestep);
        row.timestep_index = found->second;
        row.draw = uint32_t(i);
        plan.rows.push_back(row);
    }
    return plan;
}

StepRow step_row(const PlanRow& row)
{
    const StepCoefficients& c = row.coefficients;
    StepRow r{};
    r.in_scale = float(c.in_scale);
    r.x0_x = float(c.x0_x);
    r.x0_m = float(c.x0_m);
    r.c_x0 = float(c.c_x0);
    r.c_x = float(c.c_x);
    r.c_m = float(c.c_m);
    r.c_prev = float(c.c_prev);
    r.c_z = float(c.c_z);
    r.known_scale = float(c.known_scale);
    r.known_noise = float(c.known_noise);
    r.c_z_color = float(c.c_z_color.value_or(c.c_z));
    r.draw = row.draw;
    r.timestep_index = row.timestep_index;
    r.noise_stream = row.kind == PlanRowKind::undo ? 2 : 0;
    return r;
}

bool draws_noise(const SamplingPlan& plan)
{
    return std::ranges::any_of(plan.rows, [](const PlanRow& r) { return r.coefficients.c_z != 0; });
}

StepRow first_noise_row(double scale, uint32_t draw)
{
    StepRow r{};
    r.c_z = float(scale);
    r.draw = draw;
    r.noise_stream = 2;
    return r;
}

StepRow more_noise_row(double scale, uint32_t draw)
{
    StepRow r = first_noise_row(scale, draw);
    r.c_x = 1;
    return r;
}

} // namespace semrover
