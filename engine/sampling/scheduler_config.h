// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace semrover {

enum class Sampler { ddpm, ddim, dpmpp_2m, euler };
enum class BetaSchedule { linear, scaled_linear, squaredcos_cap_v2 };
enum class Prediction { epsilon, sample, v_prediction };
enum class TimestepSpacing { leading, trailing, linspace, quadratic };
enum class VarianceType { fixed_small, fixed_large, analytic };

// How far a network's x0 is off at a timestep: mean squared error of the places and of the colours of tokens.
struct PredictionError {
    double timestep, places, colors;
};

// The fields of a diffusers scheduler_config.json. Every sampler reads the first group, clip_sample included, although
// diffusers' multistep and Euler classes have no such field.
struct SchedulerConfig {
    Sampler sampler = Sampler::ddpm;
    int num_train_timesteps = 1000; // 1..10000
    BetaSchedule beta_schedule = BetaSchedule::linear;
    double beta_start = 1e-4, beta_end = 0.02; // 0 < start <= end < 1
    Prediction prediction = Prediction::epsilon;
    TimestepSpacing spacing = TimestepSpacing::leading;
    int steps_offset = 0; // added with spacing leading
    bool clip_sample = true;
    double clip_sample_range = 1;

    VarianceType variance_type = VarianceType::fixed_small; // ddpm
    std::vector<PredictionError> prediction_errors = {};    // ddpm with variance analytic; by timestep, rising
    bool set_alpha_to_one = true;                           // ddim
    double eta = 0;                                         // ddim, 0..1: share of DDPM's fresh noise in a step

    int solver_order = 2;          // dpmpp_2m, 1 or 2
    bool lower_order_final = true; // first order at the end of runs under 15 steps
    bool euler_at_final = false;

    bool final_sigma_zero = true; // dpmpp_2m and euler; else the last sigma is that of timestep 0
    bool use_karras_sigmas = false;
    std::optional<double> sigma_min = {}, sigma_max = {}; // of the karras sigmas; by default the schedule's own
    bool continuous_timesteps = false;                    // euler, with v_prediction: the network sees 0.25 ln(sigma)
};

// "ddpm", "ddim", "dpm++2m", "euler"; another name is a usage error that lists them
Result<Sampler> sampler_from_name(std::string_view name);
std::string_view sampler_name(Sampler sampler);

// Reads a scheduler_config.json: parsed, or as text, in which diffusers may write -Infinity for lambda_min_clipped.
// Defaults are those of its diffusers class, "_class_name" ("type" in golden cases). `sampler` overrides the class and
// keeps the noise schedule (SD 1.5 folders name PNDM). `warnings` gets a line for each unknown field. Bad input, by
// field name: a wrong type, a value out of bounds, or one that the engine does not implement (trained_betas,
// thresholding, rescale_betas_zero_snr, other classes, ...).
Result<SchedulerConfig> scheduler_config_from_json(const nlohmann::json& json, std::vector<std::string>& warnings,
                                                   std::optional<Sampler> sampler = {});
Result<SchedulerConfig> scheduler_config_from_text(std::string_view text, std::vector<std::string>& warnings,
                                                   std::optional<Sampler> sampler = {});
// Errors and warnings begin with the file's name.
Result<SchedulerConfig> read_scheduler_config(const Path& path, std::vector<std::string>& warnings,
                                              std::optional<Sampler> sampler = {});

} // namespace semrover
