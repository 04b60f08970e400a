// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/repaint.h"
#include "tests/support/golden_tensors.h"
#include "tests/support/json_text.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <set>
#include <utility>

namespace semrover {
namespace engine_repaint_test {

constexpr size_t kCells = 6, kKnown = 2, kWidth = 5;

// stands in for the network
float fake_model(float x, double timestep)
{
    return std::tanh(0.7f * x + 0.001f * float(timestep));
}

// a whole sampling run of kCells tokens of kWidth numbers, the first kKnown of them known if `fixed` is not empty
struct Tokens {
    std::vector<float> x, fixed;
    std::function<float()> normal;
};

std::vector<float> draw(Tokens& run)
{
    std::vector<float> z(run.x.size());
    std::generate(z.begin(), z.end(), run.normal);
    return z;
}

// sampling_case of make_cases.py, line by line, in double; the jumps' levels are spaced by the ratio
std::vector<float> reference(Tokens run, const std::vector<int>& timesteps, int ratio, double clip)
{
    const auto acp = alphas_cumprod({});
    int last = timesteps[0] + 1;
    for (int t : timesteps) {
        if (t < last) {
            const double a = acp[t], ap = t - ratio >= 0 ? acp[t - ratio] : 1.0, bt = 1 - a / ap;
            const double var = t - ratio >= 0 ? std::max((1 - ap) / (1 - a) * bt, 1e-20) : 0.0;
            const auto z = draw(run);
            const auto z2 = run.fixed.empty() ? z : draw(run);
            for (size_t i = 0; i < run.x.size(); ++i) {
                const double x0 = std::clamp(double(fake_model(run.x[i], t)), -clip, clip);
                const double mean =
                    std::sqrt(ap) * bt / (1 - a) * x0 + std::sqrt(a / ap) * (1 - ap) / (1 - a) * run.x[i];
                const bool known = i < run.fixed.size();
                run.x[i] = float(known ? std::sqrt(ap) * run.fixed[i] + std::sqrt(1 - ap) * z2[i]
                                       : mean + std::sqrt(var) * z[i]);
            }
        } else {
            const double a = acp[t], ap = acp[last];
            const auto z = draw(run);
            for (size_t i = 0; i < run.x.size(); ++i)
                run.x[i] = float(std::sqrt(a / ap) * run.x[i] + std::sqrt(1 - a / ap) * z[i]);
        }
        last = t;
    }
    return run.x;
}

// the rows of a plan in float, as the shader runs them
std::vector<float> emulate(Tokens run, const SamplingPlan& plan)
{
    std::vector<float> x0_prev(run.x.size(), 0.0f);
    for (const PlanRow& row : plan.rows) {
        const StepCoefficients& c = row.coefficients;
        const bool blend = row.kind == PlanRowKind::step && !run.fixed.empty();
        const auto z = draw(run);
        const auto z2 = blend ? draw(run) : z;
        for (size_t i = 0; i < run.x.size(); ++i) {
            const float x = run.x[i];
            if (row.kind == PlanRowKind::undo) {
                run.x[i] = float(c.c_x) * x + float(c.c_z) * z[i];
                continue;
            }
            const float m = fake_model(float(c.in_scale) * x, plan.timesteps[row.timestep_index]);
            const float x0 = std::clamp(float(c.x0_x) * x + float(c.x0_m) * m, -float(plan.clip), float(plan.clip));
            run.x[i] = float(c.c_x0) * x0 + float(c.c_x) * x + float(c.c_m) * m + float(c.c_prev) * x0_prev[i] +
                       float(c.c_z) * z[i];
            x0_prev[i] = x0;
            if (blend && i < run.fixed.size())
                run.x[i] = float(c.known_scale) * run.fixed[i] + float(c.known_noise) * z2[i];
        }
    }
    return run.x;
}

Tokens make_run(size_t known)
{
    auto random = std::make_shared<std::mt19937>(3);
    Tokens run;
    run.normal = [random] { return std::normal_distribution<float>()(*random); };
    run.x.resize(kCells * kWidth);
    run.x = draw(run);
    run.fixed.resize(known * kWidth);
    std::generate(run.fixed.begin(), run.fixed.end(), [&] { return std::clamp(run.normal(), -1.0f, 1.0f); });
    // both sides of a comparison draw the same normals from here on
    const uint32_t seed = (*random)();
    run.normal = [random, seed, started = false]() mutable {
        if (!std::exchange(started, true))
            random->seed(seed);
        return std::normal_distribution<float>()(*random);
    };
    return run;
}

SchedulerConfig ddpm()
{
    SchedulerConfig config;
    config.prediction = Prediction::sample;
    return config;
}

SamplingPlan plan_of(const SchedulerConfig& config, int steps, const RepaintOptions& repaint = {})
{
    const auto plan = plan_sampling(config, steps, repaint);
    EXPECT_TRUE(plan) << plan.error().message;
    return *plan;
}

std::vector<int> timesteps_of(const SamplingPlan& plan)
{
    std::vector<int> timesteps;
    for (const PlanRow& row : plan.rows)
        timesteps.push_back(int(plan.timesteps[row.timestep_index]));
    return timesteps;
}

TEST(Repaint, LevelsEqualTheGoldenTimesteps)
{
    for (const char* name :
         {"repaint_timesteps_1000_10_10", "repaint_timesteps_250_10_10", "repaint_timesteps_52_5_3"}) {
        const GoldenTensors golden(name);
        const int steps = golden.params.at("steps");
        auto levels =
            repaint_levels(steps, {golden.params.at("jump_length"), golden.params.at("jump_n_sample")}).value();
        for (int& level : levels)
            level *= int(golden.params.at("num_train_timesteps")) / steps;
        EXPECT_EQ(levels, golden.get<int32_t>("expect.timesteps")) << name;
    }
}

TEST(Repaint, PlansVisitTheTimestepsOfTheGoldenSamplingRuns)
{
    for (const char* name : {"sampling_ddpm", "sampling_repaint"}) {
        const GoldenTensors golden(name);
        const auto plan =
            plan_of(ddpm(), golden.params.at("steps"),
                    {golden.params.at("jump_length"), std::max(1, int(golden.params.at("jump_n_sample")))});
        EXPECT_EQ(timesteps_of(plan), golden.params.at("timesteps").get<std::vector<int>>()) << name;
        // per step one normal for every token and, with known tokens, one more; one per undo
        const size_t known = golden.header.contains("input.known_mask") ? 1 : 0;
        EXPECT_EQ(golden.header.at("input.noise").at("shape").at(0), plan.rows.size() + known * plan.evaluations);
    }
}

TEST(Repaint, RowsInFloatFollowTheReferenceLoop)
{
    struct Case {
        int steps;
        RepaintOptions repaint;
        size_t known;
    };
    for (const Case& c : {Case{10, {}, 0}, Case{10, {2, 2}, kKnown}, Case{50, {5, 2}, kKnown}, Case{25, {10, 4}, 0}}) {
        const auto plan = plan_of(ddpm(), c.steps, c.repaint);
        const auto expected = reference(make_run(c.known), timesteps_of(plan), 1000 / c.steps, 1.0);
        const auto actual = emulate(make_run(c.known), plan);
        for (size_t i = 0; i < expected.size(); ++i)
            EXPECT_NEAR(actual[i], expected[i], 2e-5) << c.steps << " steps, number " << i;
    }
}

TEST(Repaint, KnownTokensLeaveWithTheirOwnBits)
{
    for (Sampler sampler : {Sampler::ddpm, Sampler::ddim, Sampler::dpmpp_2m})
        for (TimestepSpacing spacing : {TimestepSpacing::leading, TimestepSpacing::trailing}) {
            SchedulerConfig config = ddpm();
            config.sampler = sampler;
            config.spacing = spacing;
            config.set_alpha_to_one = false;
            const Tokens run = make_run(kKnown);
            const auto x = emulate(run, plan_of(config, 20, {4, 3}));
            for (size_t i = 0; i < run.fixed.size(); ++i)
                EXPECT_EQ(x[i], run.fixed[i]) << sampler_name(sampler);
        }
}

TEST(Repaint, CleanKnownTokensHaveNoNoiseInAnyStep)
{
    const RepaintOptions options{4, 3, KnownTokens::clean};
    const auto clean = plan_of(ddpm(), 20, options), noised = plan_of(ddpm(), 20, {4, 3});
    ASSERT_EQ(clean.rows.size(), noised.rows.size());
    EXPECT_EQ(clean.known, KnownTokens::clean);
    for (size_t i = 0; i < clean.rows.size(); ++i) {
        const StepCoefficients &c = clean.rows[i].coefficients, &n = noised.rows[i].coefficients;
        EXPECT_EQ(c.c_z, n.c_z); // the others are denoised alike
        if (clean.rows[i].kind == PlanRowKind::step) {
            EXPECT_EQ(c.known_scale, 1);
            EXPECT_EQ(c.known_noise, 0);
        }
    }
}

TEST(Repaint, WithoutJumpsThePlanIsTheSchedule)
{
    const auto schedule = make_schedule(ddpm(), 20).value();
    for (const RepaintOptions& options :
         {RepaintOptions{}, RepaintOptions{1, 1}, RepaintOptions{0, 5}, RepaintOptions{20, 5}}) {
        const auto plan = plan_of(ddpm(), 20, options);
        ASSERT_EQ(plan.rows.size(), 20u);
        EXPECT_EQ(plan.evaluations, 20u);
        for (size_t i = 0; i < 20; ++i) {
            EXPECT_EQ(plan.rows[i].coefficients.timestep, schedule.steps[i].timestep);
            EXPECT_EQ(plan.rows[i].coefficients.c_x0, schedule.steps[i].c_x0);
        }
    }
}

TEST(Repaint, JumpsMoveAlongTrailingTimesteps)
{
    SchedulerConfig config = ddpm();
    config.spacing = TimestepSpacing::trailing;
    const auto plan = plan_of(config, 4, {1, 2});
    EXPECT_EQ(timesteps_of(plan), (std::vector<int>{999, 749, 999, 749, 499, 749, 499, 249, 499, 249}));
    const auto abar = alphas_cumprod(config);
    const auto up = std::find_if(plan.rows.begin(), plan.rows.end(),
                                 [](const PlanRow& row) { return row.kind == PlanRowKind::undo; });
    ASSERT_NE(up, plan.rows.end());
    EXPECT_NEAR(up->coefficients.c_x, std::sqrt(abar[999] / abar[749]), 1e-12);
    EXPECT_NEAR(up->coefficients.c_x * up->coefficients.c_x + up->coefficients.c_z * up->coefficients.c_z, 1, 1e-12);
}

TEST(Repaint, AMultistepSamplerForgetsItsPreviousPredictionAfterAJump)
{
    SchedulerConfig config = ddpm();
    config.sampler = Sampler::dpmpp_2m;
    const auto plan = plan_of(config, 20, {5, 2});
    size_t second_order = 0;
    for (size_t i = 0; i < plan.rows.size(); ++i) {
        const bool fresh = i == 0 || plan.rows[i - 1].kind == PlanRowKind::undo;
        EXPECT_FALSE(fresh && plan.rows[i].coefficients.c_prev != 0) << "row " << i;
        second_order += plan.rows[i].coefficients.c_prev != 0;
    }
    EXPECT_GT(second_order, 10u);
}

TEST(Repaint, EveryRowHasItsOwnDrawAndEveryTimestepIsListedOnce)
{
    const auto plan = plan_of(ddpm(), 250, {10, 10});
    EXPECT_EQ(plan.evaluations, 2410u); // docs/method.md §3.3
    EXPECT_EQ(plan.rows.size() - plan.evaluations, 2160u);
    EXPECT_EQ(plan.timesteps.size(), 250u);
    EXPECT_EQ(std::set<double>(plan.timesteps.begin(), plan.timesteps.end()).size(), 250u);
    for (size_t i = 0; i < plan.rows.size(); ++i)
        EXPECT_EQ(plan.rows[i].draw, i);
}

TEST(Repaint, PlansThatCannotBeAreRefused)
{
    EXPECT_FALSE(plan_sampling(ddpm(), 0));
    EXPECT_FALSE(plan_sampling(ddpm(), 20, {-1, 2}));
    EXPECT_FALSE(plan_sampling(ddpm(), 20, {1, 0}));
    EXPECT_NE(plan_sampling(ddpm(), 1000, {1, 10000}).error().message.find("rows, at most 1000000"), std::string::npos);
    SchedulerConfig config = ddpm();
    config.sampler = Sampler::euler;
    EXPECT_TRUE(plan_sampling(config, 20));
    EXPECT_NE(plan_sampling(config, 20, {5, 2}).error().message.find("euler"), std::string::npos);
}

} // namespace engine_repaint_test
} // namespace semrover
