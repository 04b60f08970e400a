// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/schedule.h"
#include "tests/support/golden_tensors.h"
#include "tests/support/json_text.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

namespace semrover {
namespace engine_schedule_test {

SchedulerConfig parse(const nlohmann::json& json)
{
    std::vector<std::string> warnings;
    const auto config = scheduler_config_from_json(json, warnings);
    EXPECT_TRUE(config) << config.error().message;
    EXPECT_TRUE(warnings.empty()) << warnings.front();
    return *config;
}

Schedule schedule_of(const SchedulerConfig& config, int steps)
{
    const auto schedule = make_schedule(config, steps);
    EXPECT_TRUE(schedule) << schedule.error().message;
    return *schedule;
}

// one value through one row, in float as the shader does it
float step(const StepCoefficients& row, double clip, float x, float m, float z, float& x0_prev)
{
    const float x0 = std::clamp(float(row.x0_x) * x + float(row.x0_m) * m, -float(clip), float(clip));
    const float next = float(row.c_x0) * x0 + float(row.c_x) * x + float(row.c_m) * m + float(row.c_prev) * x0_prev +
                       float(row.c_z) * z;
    x0_prev = x0;
    return next;
}

class GoldenScheduler : public testing::TestWithParam<const char*> {};

TEST_P(GoldenScheduler, EveryStateFollowsInFloat)
{
    const GoldenTensors golden(GetParam());
    const Schedule schedule = schedule_of(parse(golden.params), golden.params.at("num_inference_steps"));
    const auto timesteps = golden.get<float>("expect.timesteps");
    ASSERT_EQ(schedule.steps.size(), timesteps.size());
    const auto outputs = golden.get<float>("input.model_outputs"), states = golden.get<float>("expect.states");
    const auto noise = golden.header.contains("input.noise") ? golden.get<float>("input.noise")
                                                             : std::vector<float>(outputs.size(), 0.0f);
    std::vector<float> x = golden.get<float>("input.sample"), x0_prev(x.size(), 0.0f);
    double worst = 0;
    for (size_t i = 0; i < timesteps.size(); ++i) {
        EXPECT_NEAR(schedule.steps[i].timestep, timesteps[i], 1e-5 * std::max(1.0f, std::abs(timesteps[i])));
        for (size_t j = 0; j < x.size(); ++j) {
            const size_t at = i * x.size() + j;
            x[j] = step(schedule.steps[i], schedule.clip, x[j], outputs[at], noise[at], x0_prev[j]);
            worst = std::max(worst, std::abs(double(x[j]) - states[at + x.size()]) /
                                        std::max(1.0, std::abs(double(states[at + x.size()]))));
        }
    }
    EXPECT_LT(worst, 1e-5) << "measured 5e-7 to 2.4e-6 over the six cases";
}

INSTANTIATE_TEST_SUITE_P(All, GoldenScheduler,
                         testing::Values("scheduler_ddpm_sample", "scheduler_ddim_epsilon", "scheduler_ddim_sample",
                                         "scheduler_dpmpp_2m", "scheduler_dpmpp_2m_sample", "scheduler_euler_svd"),
                         [](const auto& info) { return std::string(info.param); });

SchedulerConfig config_of(Sampler sampler, Prediction prediction, TimestepSpacing spacing)
{
    SchedulerConfig config;
    config.sampler = sampler;
    config.prediction = prediction;
    config.spacing = spacing;
    config.clip_sample = false;
    return config;
}

std::vector<double> timesteps_of(const SchedulerConfig& config, int steps)
{
    std::vector<double> timesteps;
    for (const StepCoefficients& row : schedule_of(config, steps).steps)
        timesteps.push_back(row.timestep);
    return timesteps;
}

// x' as a sum of x, the network's output m and fresh noise, where x0 is not clipped
// Of normal x0 with this variance the best prediction is known, and so is how far it is off. Steps of any length then
// have to keep the variance of x that noise puts on such x0.
struct NormalData {
    double variance;
    double slope(double abar) const { return std::sqrt(abar) * variance / spread(abar); } // x0 = slope x
    double error(double abar) const { return variance * (1 - abar) / spread(abar); }
    double spread(double abar) const { return abar * variance + 1 - abar; }
};

TEST(Schedule, AnalyticNoiseKeepsTheVarianceOfNormalDataInFewSteps)
{
    const NormalData places{0.3}, colors{0.07};
    SchedulerConfig config;
    config.prediction = Prediction::sample;
    config.spacing = TimestepSpacing::quadratic;
    config.variance_type = VarianceType::analytic;
    const auto abar = alphas_cumprod(config);
    for (int t = 0; t < 1000; ++t)
        config.prediction_errors.push_back({double(t), places.error(abar[t]), colors.error(abar[t])});
    const auto last_spread = [](const Schedule& schedule, const NormalData& data, bool color) {
        double spread = data.spread(schedule.steps.front().abar);
        for (size_t i = 0; i + 1 < schedule.steps.size(); ++i) {
            const StepCoefficients& s = schedule.steps[i];
            const double kept = s.c_x0 * data.slope(s.abar) + s.c_x,
                         fresh = color ? s.c_z_color.value_or(s.c_z) : s.c_z;
            spread = kept * kept * spread + fresh * fresh;
        }
        return spread / data.spread(schedule.steps.back().abar);
    };
    for (int steps : {2, 5, 16, 100}) {
        const Schedule analytic = schedule_of(config, steps);
        EXPECT_NEAR(last_spread(analytic, places, false), 1, 1e-9) << steps;
        EXPECT_NEAR(last_spread(analytic, colors, true), 1, 1e-9) << steps;
        EXPECT_EQ(analytic.steps.back().c_z, 0);
        EXPECT_FALSE(analytic.steps.back().c_z_color);
    }
    config.variance_type = VarianceType::fixed_small;
    EXPECT_LT(last_spread(schedule_of(config, 16), places, false), 0.9);
}

TEST(Schedule, ErrorsAreInterpolatedBetweenRowsAndConstantBeyondThem)
{
    SchedulerConfig config;
    config.spacing = TimestepSpacing::quadratic;
    config.variance_type = VarianceType::analytic;
    config.prediction_errors = {{100, 0.1, 0.02}, {500, 0.3, 0.06}};
    const Schedule schedule = schedule_of(config, 10);
    const auto errors = [&](double timestep) {
        for (const StepCoefficients& s : schedule.steps)
            if (s.timestep == timestep) {
                SchedulerConfig plain = config;
                plain.variance_type = VarianceType::fixed_small;
                const Schedule small = schedule_of(plain, 10);
                const double least = std::pow(small.steps[&s - schedule.steps.data()].c_z, 2);
                return std::pair((s.c_z * s.c_z - least) / (s.c_x0 * s.c_x0),
                                 (*s.c_z_color * *s.c_z_color - least) / (s.c_x0 * s.c_x0));
            }
        return std::pair(-1.0, -1.0);
    };
    EXPECT_NEAR(errors(39).first, 0.1, 1e-9); // 1000 (2 / 10)^2 - 1
    EXPECT_NEAR(errors(39).second, 0.02, 1e-9);
    EXPECT_NEAR(errors(249).first, 0.1 + 0.2 * 149 / 400, 1e-9);
    EXPECT_NEAR(errors(249).second, 0.02 + 0.04 * 149 / 400, 1e-9);
    EXPECT_NEAR(errors(809).first, 0.3, 1e-9);
}

TEST(Schedule, DdimWithAllOfItsFreshNoiseIsDdpm)
{
    for (TimestepSpacing spacing : {TimestepSpacing::trailing, TimestepSpacing::quadratic})
        for (Prediction prediction : {Prediction::sample, Prediction::epsilon, Prediction::v_prediction}) {
            SchedulerConfig ddim = config_of(Sampler::ddim, prediction, spacing);
            ddim.eta = 1;
            const Schedule a = schedule_of(ddim, 10),
                           b = schedule_of(config_of(Sampler::ddpm, prediction, spacing), 10);
            for (size_t i = 0; i < 10; ++i) {
                const StepCoefficients &p = a.steps[i], &q = b.steps[i];
                EXPECT_NEAR(p.c_x0 * p.x0_x + p.c_x, q.c_x0 * q.x0_x + q.c_x, 1e-12 * (1 + std::abs(q.c_x0 * q.x0_x)));
                EXPECT_NEAR(p.c_x0 * p.x0_m + p.c_m, q.c_x0 * q.x0_m + q.c_m, 1e-12 * (1 + std::abs(q.c_x0 * q.x0_m)));
                EXPECT_NEAR(p.c_z, q.c_z, 1e-12);
            }
        }
}

// whatever eta, a state at the level of one step comes to the level of the next: variance 1 - abar
TEST(Schedule, DdimKeepsTheLevelOfNoiseWithAnyShareOfFreshNoise)
{
    for (double eta : {0., 0.3, 0.5, 1.}) {
        SchedulerConfig config = config_of(Sampler::ddim, Prediction::sample, TimestepSpacing::quadratic);
        config.eta = eta;
        const Schedule schedule = schedule_of(config, 12);
        for (size_t i = 0; i + 1 < 12; ++i) {
            const StepCoefficients& step = schedule.steps[i];
            const double next = schedule.steps[i + 1].abar; // the network knows x0: m = x0, x = sqrt(abar) x0 + noise
            EXPECT_NEAR(step.c_x0 + step.c_m + step.c_x * std::sqrt(step.abar), std::sqrt(next), 1e-12);
            EXPECT_NEAR(step.c_x * step.c_x * (1 - step.abar) + step.c_z * step.c_z, 1 - next, 1e-12);
        }
        EXPECT_EQ(schedule.steps.back().c_z, 0);
    }
}

TEST(Schedule, TimestepsRoundAsNumpyDoes)
{
    const auto spaced = [](Sampler sampler, TimestepSpacing spacing, int steps) {
        return timesteps_of(config_of(sampler, Prediction::sample, spacing), steps);
    };
    using List = std::vector<double>;
    EXPECT_EQ(spaced(Sampler::ddpm, TimestepSpacing::leading, 3), (List{666, 333, 0}));
    EXPECT_EQ(spaced(Sampler::ddpm, TimestepSpacing::trailing, 3), (List{999, 666, 332}));
    EXPECT_EQ(spaced(Sampler::ddpm, TimestepSpacing::linspace, 3), (List{999, 500, 0})); // 499.5 goes to the even one
    EXPECT_EQ(spaced(Sampler::dpmpp_2m, TimestepSpacing::linspace, 2), (List{999, 500}));
    EXPECT_EQ(spaced(Sampler::dpmpp_2m, TimestepSpacing::leading, 3), (List{750, 500, 250}));
    EXPECT_EQ(spaced(Sampler::euler, TimestepSpacing::linspace, 3), (List{999, 499.5, 0})); // and here it stays
    const auto halves = spaced(Sampler::ddim, TimestepSpacing::trailing, 16);
    EXPECT_EQ(halves[1], 937); // 937.5 - 1, to even before the 1 is taken
    EXPECT_EQ(halves[3], 811); // 812.5
    EXPECT_EQ(spaced(Sampler::ddpm, TimestepSpacing::trailing, 1000).back(), 0);
    for (Sampler sampler : {Sampler::ddpm, Sampler::ddim, Sampler::dpmpp_2m})
        EXPECT_EQ(spaced(sampler, TimestepSpacing::quadratic, 4), (List{999, 561, 249, 61})); // 562.5 to even, less 1
    for (int steps = 1; steps <= 1000; ++steps) {
        const List quadratic = spaced(Sampler::ddpm, TimestepSpacing::quadratic, steps);
        EXPECT_EQ(quadratic.front(), 999);
        EXPECT_GE(quadratic.back(), 0);
        EXPECT_EQ(std::ranges::adjacent_find(quadratic, std::less_equal<>()), quadratic.end()) << steps;
    }
    for (int steps = 1; steps <= 1000; ++steps)
        EXPECT_EQ(spaced(Sampler::ddim, TimestepSpacing::trailing, steps).size(), size_t(steps));
}

TEST(Schedule, ANetworkThatKnowsTheAnswerIsFollowedToItByEverySamplerAndPrediction)
{
    const double answer = 0.37;
    for (Sampler sampler : {Sampler::ddpm, Sampler::ddim, Sampler::dpmpp_2m, Sampler::euler})
        for (TimestepSpacing spacing : {TimestepSpacing::leading, TimestepSpacing::trailing, TimestepSpacing::linspace,
                                        TimestepSpacing::quadratic})
            for (int steps : {1, 2, 10, 20}) {
                std::vector<double> ends;
                for (Prediction prediction : {Prediction::sample, Prediction::epsilon, Prediction::v_prediction}) {
                    const Schedule schedule = schedule_of(config_of(sampler, prediction, spacing), steps);
                    double x = 1.7 * schedule.init_noise_sigma, x0_prev = 0;
                    for (const StepCoefficients& row : schedule.steps) {
                        const double alpha = std::sqrt(row.abar), sigma = std::sqrt(1 - row.abar);
                        const double scaled = sampler == Sampler::euler ? row.in_scale * x : x;
                        const double noise = (scaled - alpha * answer) / sigma;
                        const double m = prediction == Prediction::sample    ? answer
                                         : prediction == Prediction::epsilon ? noise
                                                                             : alpha * noise - sigma * answer;
                        const double x0 = row.x0_x * x + row.x0_m * m;
                        EXPECT_NEAR(x0, answer, 1e-9);
                        x = row.c_x0 * x0 + row.c_x * x + row.c_m * m + row.c_prev * x0_prev + row.c_z * 0.3;
                        x0_prev = x0;
                    }
                    // note: diffusers' DDIM strides past the end when the steps do not divide 1000 evenly
                    EXPECT_NEAR(x, answer, 0.02) << sampler_name(sampler) << " " << steps;
                    ends.push_back(x);
                }
                EXPECT_NEAR(ends[0], ends[1], 1e-9);
                EXPECT_NEAR(ends[0], ends[2], 1e-9);
            }
}

TEST(Schedule, KnownTokensAreNoisedToTheLevelOfTheNextStepAndEndExact)
{
    for (Sampler sampler : {Sampler::ddpm, Sampler::ddim, Sampler::dpmpp_2m})
        for (TimestepSpacing spacing : {TimestepSpacing::leading, TimestepSpacing::trailing}) {
            const Schedule schedule = schedule_of(config_of(sampler, Prediction::sample, spacing), 20);
            ASSERT_TRUE(schedule.can_jump());
            EXPECT_NEAR(schedule.init_known_scale, std::sqrt(schedule.steps.front().abar), 1e-12);
            for (size_t i = 0; i + 1 < schedule.steps.size(); ++i) {
                const double level = schedule.steps[i + 1].abar;
                EXPECT_NEAR(schedule.steps[i].known_scale, std::sqrt(level), 1e-12);
                EXPECT_NEAR(schedule.steps[i].known_noise, std::sqrt(1 - level), 1e-12);
            }
            EXPECT_EQ(schedule.steps.back().known_scale, 1.0);
            EXPECT_EQ(schedule.steps.back().known_noise, 0.0);
            EXPECT_EQ(schedule.steps.back().c_z, 0.0);
        }
    // euler's x is x0 + sigma noise
    const Schedule euler = schedule_of(config_of(Sampler::euler, Prediction::sample, TimestepSpacing::trailing), 20);
    EXPECT_FALSE(euler.can_jump());
    EXPECT_EQ(euler.init_known_scale, 1.0);
    for (size_t i = 0; i < euler.steps.size(); ++i) {
        const double next = i + 1 < euler.steps.size() ? euler.steps[i + 1].abar : 1;
        EXPECT_EQ(euler.steps[i].known_scale, 1.0);
        EXPECT_NEAR(euler.steps[i].known_noise, std::sqrt(1 / next - 1), 1e-9);
    }
}

TEST(Schedule, StepsThatTheMultistepSolverTakesTwiceStayFinite)
{
    const Schedule schedule =
        schedule_of(config_of(Sampler::dpmpp_2m, Prediction::sample, TimestepSpacing::linspace), 1000);
    for (const StepCoefficients& row : schedule.steps)
        EXPECT_TRUE(std::isfinite(row.c_x0 + row.c_prev + row.c_x)) << row.timestep;
    for (const StepCoefficients& row : schedule.restarts)
        EXPECT_EQ(row.c_prev, 0.0);
}

TEST(Schedule, CumulativeAlphasStayInOrder)
{
    for (BetaSchedule beta : {BetaSchedule::linear, BetaSchedule::scaled_linear, BetaSchedule::squaredcos_cap_v2}) {
        SchedulerConfig config;
        config.beta_schedule = beta;
        const auto abar = alphas_cumprod(config);
        ASSERT_EQ(abar.size(), 1000u);
        EXPECT_TRUE(std::is_sorted(abar.rbegin(), abar.rend()));
        EXPECT_GT(abar.back(), 0);
    }
    EXPECT_NEAR(alphas_cumprod({})[999], 4.0358e-5, 1e-8); // arXiv 2006.11239
}

TEST(Schedule, StepsOutOfRangeAreRefused)
{
    SchedulerConfig config;
    EXPECT_FALSE(make_schedule(config, 0));
    EXPECT_FALSE(make_schedule(config, 1001));
    EXPECT_TRUE(make_schedule(config, 1000));
    config.steps_offset = 1;
    const auto late = make_schedule(config, 1000);
    ASSERT_FALSE(late);
    EXPECT_NE(late.error().message.find("steps_offset 1"), std::string::npos) << late.error().message;
}

TEST(SchedulerConfig, TheModelOfTheDemoIsRead)
{
    std::ifstream file(std::string(SEMROVER_SOURCE_DIR) + "/assets/model/voxfield_scheduler/scheduler_config.json");
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    std::vector<std::string> warnings;
    const auto config = scheduler_config_from_text(text, warnings);
    ASSERT_TRUE(config) << config.error().message;
    EXPECT_EQ(config->sampler, Sampler::ddpm);
    EXPECT_EQ(config->spacing, TimestepSpacing::quadratic);
    EXPECT_EQ(config->prediction, Prediction::sample);
    EXPECT_TRUE(warnings.empty());
    const auto other = scheduler_config_from_text(text, warnings, Sampler::dpmpp_2m);
    ASSERT_TRUE(other) << other.error().message;
    EXPECT_EQ(other->sampler, Sampler::dpmpp_2m);
    EXPECT_TRUE(other->clip_sample);
}

TEST(SchedulerConfig, UnknownFieldsWarnAndPythonInfinitiesAreRead)
{
    std::vector<std::string> warnings;
    const auto config = scheduler_config_from_text(
        R"({"_class_name": "DPMSolverMultistepScheduler", "_diffusers_version": "0.30", "lambda_min_clipped": -Infinity,
            "variance_type": null, "skip_prk_steps": true, "note": "\"-Infinity"})",
        warnings);
    ASSERT_TRUE(config) << config.error().message;
    EXPECT_EQ(config->spacing, TimestepSpacing::linspace);
    EXPECT_FALSE(config->clip_sample);
    ASSERT_EQ(warnings.size(), 2u);
    EXPECT_NE(warnings[1].find("skip_prk_steps"), std::string::npos);
}

TEST(SchedulerConfig, WhatIsNotImplementedIsRefusedByName)
{
    const auto refused = [](const std::string& fields, const std::string& name) {
        std::vector<std::string> warnings;
        const auto config = scheduler_config_from_text("{\"_class_name\": \"DDPMScheduler\"" + fields + "}", warnings);
        ASSERT_FALSE(config) << fields;
        EXPECT_EQ(config.error().code, ErrorCode::bad_input);
        EXPECT_NE(config.error().message.find(name), std::string::npos) << config.error().message;
    };
    refused(R"(, "beta_schedule": "sigmoid")", "beta_schedule is \"sigmoid\"");
    refused(R"(, "variance_type": "learned_range")", "variance_type");
    refused(R"(, "variance_type": "analytic")", "prediction_errors is not given");
    refused(R"(, "prediction_errors": [[1, 0.1]])", "prediction_errors");
    refused(R"(, "prediction_errors": [[1, 0.1, "a"]])", "prediction_errors");
    refused(R"(, "prediction_errors": [[1, 0.1, -0.1]])", "prediction_errors");
    refused(R"(, "prediction_errors": [[2, 0.1, 0.1], [2, 0.1, 0.1]])", "rows of rising timesteps");
    refused(R"(, "thresholding": true)", "thresholding");
    refused(R"(, "rescale_betas_zero_snr": true)", "rescale_betas_zero_snr");
    refused(R"(, "trained_betas": [0.1, 0.2])", "trained_betas");
    refused(R"(, "algorithm_type": "sde-dpmsolver++")", "algorithm_type");
    refused(R"(, "solver_order": 3)", "solver_order");
    refused(R"(, "num_train_timesteps": 10001)", "num_train_timesteps");
    refused(R"(, "num_train_timesteps": 1e300)", "num_train_timesteps");
    refused(R"(, "num_train_timesteps": "1000")", "num_train_timesteps");
    refused(R"(, "beta_start": 0.5, "beta_end": 0.1)", "beta_start");
    refused(R"(, "beta_end": 1.5)", "beta_end");
    refused(R"(, "clip_sample": 1)", "clip_sample");
    refused(R"(, "_class_name": "PNDMScheduler")", "PNDMScheduler");
    refused(R"(, "_class_name": 3)", "_class_name");
    refused(R"(, "x": )", "not JSON");
    refused(", \"clip_sample\": " + std::string(100000, '[') + std::string(100000, ']'), "clip_sample is an array");
    std::vector<std::string> warnings;
    EXPECT_FALSE(scheduler_config_from_text("[]", warnings));
    EXPECT_TRUE(scheduler_config_from_text(R"({"_class_name": "PNDMScheduler"})", warnings, Sampler::ddim));
}

TEST(SchedulerConfig, SamplersHaveNames)
{
    for (Sampler sampler : {Sampler::ddpm, Sampler::ddim, Sampler::dpmpp_2m, Sampler::euler})
        EXPECT_EQ(sampler_from_name(sampler_name(sampler)).value(), sampler);
    const auto unknown = sampler_from_name("heun");
    ASSERT_FALSE(unknown);
    EXPECT_EQ(unknown.error().code, ErrorCode::usage);
    EXPECT_NE(unknown.error().message.find("dpm++2m"), std::string::npos);
}

} // namespace engine_schedule_test
} // namespace semrover
