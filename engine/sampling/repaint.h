// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/sampling/schedule.h"
#include "shaders/lib/step_row.h"

#include <cstdint>
#include <string_view>
#include <vector>

namespace semrover {

// How the network sees known tokens at each step.
enum class KnownTokens {
    noised, // with the current step's noise, as in RePaint
    clean,  // without noise: for a network that was trained that way (tools/train, known_share)
};

// RePaint, arXiv 2201.09865: every jump_length steps, add noise to get back up jump_length steps, and denoise them
// again, jump_n_sample times in all. With jump_length 0 or jump_n_sample 1 there are no jumps.
struct RepaintOptions {
    int jump_length = 0;   // 0..10000
    int jump_n_sample = 1; // 1..10000
    KnownTokens known = KnownTokens::noised;
};

constexpr size_t kMaxPlanRows = 1'000'000;

// Levels visited by RePaint, `steps` - 1 the noisiest and 0 the last, as in diffusers' RePaintScheduler (which
// multiplies them by num_train_timesteps / steps). A level below the one before it is a denoising step at that level,
// a level above it a step back up. Bad input: options out of range, or more than kMaxPlanRows levels.
Result<std::vector<int>> repaint_levels(int steps, const RepaintOptions& options);

enum class PlanRowKind : uint32_t {
    step, // network, then the step; known tokens take known_scale * fixed + known_noise * z
    undo, // no network: x' = c_x * x + c_z * z for every token, the known ones too; all other coefficients are 0
};

struct PlanRow {
    PlanRowKind kind = PlanRowKind::step;
    StepCoefficients coefficients;
    uint32_t draw = 0;           // index of the row in the plan: the part of the noise key that changes between rows
    uint32_t timestep_index = 0; // into SamplingPlan::timesteps; in an undo row, of the timestep gone up to
};

// A whole sampling run, row by row. One plan is used for any number of voxels.
struct SamplingPlan {
    std::vector<PlanRow> rows;
    std::vector<double> timesteps; // distinct ones, in the order they are first visited
    size_t evaluations = 0;        // rows of kind step: how often the network runs
    double init_noise_sigma = 1;   // the first x is this times a standard normal
    double init_known_scale = 1;   // and, where it is known, this times what is known
    double clip = Schedule::kNoClip;
    KnownTokens known = KnownTokens::noised; // clean: after rows of kind undo, too, known tokens take `fixed`
};

// The plan of `steps` denoising steps with RePaint's jumps over them. A jump moves along the schedule's own timesteps
// whatever their spacing, from abar to abar': x' = sqrt(abar' / abar) x + sqrt(1 - abar' / abar) z, where abar is that
// of the timestep just denoised, as in diffusers. After a jump a multistep sampler starts again at first order.
// Bad input: what make_schedule and repaint_levels refuse, and jumps with euler.
Result<SamplingPlan> plan_sampling(const SchedulerConfig& config, int steps, const RepaintOptions& repaint = {});

// ---- the table of a run on the device

// draws of the noise before a plan's first row; the rows' own are 0 up to kMaxPlanRows
constexpr uint32_t kFirstDraw = 0xfffff;         // the first noise
constexpr uint32_t kPreviousFrameDraw = 0xffffe; // the noise on the frame before

StepRow step_row(const PlanRow& row); // of a plan, for the device

// whether any row adds noise; else step_update takes any finite numbers for it
bool draws_noise(const SamplingPlan& plan);

// x = scale z, and x += scale z: rows for step_renoise, with noise of the stream of all tokens
StepRow first_noise_row(double scale, uint32_t draw);
StepRow more_noise_row(double scale, uint32_t draw);

} // namespace semrover
