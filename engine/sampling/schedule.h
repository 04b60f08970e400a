// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/sampling/scheduler_config.h"

#include <optional>
#include <vector>

namespace semrover {

// One denoising step of any sampler, as numbers for one linear kernel; x is the state, m the network's output after
// guidance, z a standard normal, x0_prev the x0 of the previous step:
//     network input    in = in_scale * x
//     prediction       x0 = clamp(x0_x * x + x0_m * m, -clip, clip)
//     next state       x' = c_x0 * x0 + c_x * x + c_m * m + c_prev * x0_prev + c_z * z
//     known tokens     x' = known_scale * fixed + known_noise * z
// note: terms with a zero coefficient are still multiplied, so x0_prev has to be finite from the first step on.
struct StepCoefficients {
    double timestep = 0; // what the network is evaluated at
    double in_scale = 1;
    double x0_x = 0, x0_m = 0;
    double c_x0 = 0, c_x = 0, c_m = 0, c_prev = 0, c_z = 0;
    std::optional<double> c_z_color = {}; // c_z of the colours of tokens, where it is another
    // level after the step: sqrt(abar), sqrt(1 - abar), of euler 1 and sigma; 1 and 0 at the end
    double known_scale = 1, known_noise = 0;
    double abar = 1; // cumulative alpha of x before the step
};

struct Schedule {
    static constexpr double kNoClip = 3e38; // fits a float

    Sampler sampler = Sampler::ddpm;
    std::vector<StepCoefficients> steps;
    std::vector<StepCoefficients> restarts; // the same steps when there is no x0_prev to build on: c_prev is 0
    double init_noise_sigma = 1;            // the first x is this times a standard normal
    double init_known_scale = 1;            // and, where it is known, this times what is known
    double clip = kNoClip;

    // RePaint's jumps are those of an x whose variance does not grow; euler's does
    bool can_jump() const { return sampler != Sampler::euler; }
};

constexpr int kMaxInferenceSteps = 10000;

// cumulative products of 1 - beta [num_train_timesteps], in double; diffusers rounds betas to float first
std::vector<double> alphas_cumprod(const SchedulerConfig& config);

// The coefficients of `steps` denoising steps, after diffusers' DDPMScheduler, DDIMScheduler (with eta),
// DPMSolverMultistepScheduler (dpmsolver++, midpoint) and EulerDiscreteScheduler (no churn), with their timesteps.
// note: DDPM adds no noise in its last step; diffusers adds 1e-10 z there when the last timestep is not 0.
// Bad input: steps not in 1..min(10000, num_train_timesteps), or an offset that moves a timestep out of range.
Result<Schedule> make_schedule(const SchedulerConfig& config, int steps);

} // namespace semrover
