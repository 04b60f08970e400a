// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/voxfield/token_sampler.h"
#include "tests/support/says.h"

#include <gtest/gtest.h>

namespace semrover {
namespace engine_sampler_test {

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

const Transformer& transformer()
{
    static const std::unique_ptr<Transformer> t =
        std::move(*Transformer::load(device(), SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model", DType::f16));
    return *t;
}

// a patch of ground whose first `known` voxels are given
RegionInput patch(int32_t x, uint32_t cells, uint32_t known)
{
    RegionInput r;
    const size_t channels = transformer().config().channels();
    r.fixed.assign(cells * channels, 0.f);
    for (uint32_t i = 0; i < cells; ++i) {
        r.cells.push_back({x + int32_t(i % 7), int32_t(i / 7), 0});
        r.labels.push_back(i % 20);
        r.known.push_back(i < known);
        for (size_t k = 0; k < channels; ++k)
            r.fixed[i * channels + k] = float((i * 7 + k * 3) % 201) / 100.f - 1;
    }
    return r;
}

SamplingPlan plan(Sampler sampler, int steps, RepaintOptions repaint)
{
    SchedulerConfig config;
    config.sampler = sampler;
    config.prediction = Prediction::sample;
    config.spacing = TimestepSpacing::trailing;
    return *plan_sampling(config, steps, repaint);
}

std::vector<float> run(const SamplingPlan& p, SamplerOptions options, const std::vector<RegionInput>& regions,
                       const Transformer& network = transformer())
{
    auto sampler = TokenSampler::create(device(), network, p, std::move(options));
    EXPECT_TRUE(sampler) << sampler.error().message;
    auto tokens = (*sampler)->run(regions);
    EXPECT_TRUE(tokens) << tokens.error().message;
    return *tokens;
}

TEST(engine_sampler, a_region_is_the_same_alone_and_in_any_batch)
{
    const SamplingPlan p = plan(Sampler::ddpm, 3, {2, 2});
    const RegionInput a = patch(0, 50, 20), b = patch(40, 33, 0), c = patch(-90, 17, 5);
    const std::vector<float> alone = run(p, {{2}, 7}, {b});
    const std::vector<float> batched = run(p, {{2}, 7}, {a, b, c});
    const size_t channels = transformer().config().channels();
    const std::vector<float> part(batched.begin() + int64_t(50 * channels), batched.begin() + int64_t(83 * channels));
    EXPECT_EQ(alone, part);
}

TEST(engine_sampler, known_tokens_leave_as_they_came_with_every_sampler)
{
    const RegionInput region = patch(3, 40, 25);
    for (Sampler sampler : {Sampler::ddpm, Sampler::ddim, Sampler::dpmpp_2m}) {
        const std::vector<float> tokens = run(plan(sampler, 4, {2, 2}), {{3}, 1}, {region});
        for (size_t i = 0; i < 25 * size_t(transformer().config().channels()); ++i)
            ASSERT_EQ(tokens[i], region.fixed[i]) << sampler_name(sampler) << " element " << i;
    }
}

TEST(engine_sampler, names_the_first_number_that_is_none)
{
    RegionInput broken = patch(60, 1, 1);
    broken.fixed[5] = broken.fixed[9] = std::numeric_limits<float>::infinity();
    const auto sampler = *TokenSampler::create(device(), transformer(), plan(Sampler::ddpm, 2, {}), {{2}, 1});
    const std::vector<RegionInput> regions = {patch(0, 40, 0), broken};
    EXPECT_TRUE(says(sampler->run(regions), "the network returned inf for channel 5 of token 40"));
    ASSERT_TRUE(sampler->begin(regions));
    ASSERT_TRUE(*sampler->step(sampler->rows()));
    EXPECT_TRUE(says(sampler->finish_points(), "the network returned inf for channel 5 of token 40"));
}

// what a network makes of noise is not what it makes of the tokens themselves, so the others see how known ones come
TEST(engine_sampler, clean_known_tokens_leave_as_they_came_and_are_seen_without_noise)
{
    const RegionInput region = patch(3, 40, 25);
    const size_t given = 25 * size_t(transformer().config().channels());
    for (const RepaintOptions& repaint : {RepaintOptions{0, 1, KnownTokens::clean}, {2, 2, KnownTokens::clean}}) {
        const std::vector<float> clean = run(plan(Sampler::ddpm, 4, repaint), {{3}, 1}, {region});
        for (size_t i = 0; i < given; ++i)
            ASSERT_EQ(clean[i], region.fixed[i]);
        RepaintOptions other = repaint;
        other.known = KnownTokens::noised;
        EXPECT_NE(clean, run(plan(Sampler::ddpm, 4, other), {{3}, 1}, {region}));
    }
}

// one step from pure noise: with all tokens but one known, its x0 is the network's answer to the clean tokens
TEST(engine_sampler, from_the_first_step_on_clean_tokens_have_no_noise)
{
    const RegionInput region = patch(0, 12, 11);
    const auto one = [&](uint64_t seed, KnownTokens known) {
        SamplerOptions options{{1}, seed};
        const size_t channels = transformer().config().channels();
        options.noise = [=](size_t, std::span<float> normals) {
            for (size_t i = 0; i < normals.size(); ++i) // only the noise of known tokens depends on the seed
                normals[i] = i < 11 * channels ? float((i * (seed + 3)) % 17) / 8.5f - 1 : 0.25f;
        };
        return run(plan(Sampler::ddpm, 1, {0, 1, known}), options, {region});
    };
    EXPECT_EQ(one(1, KnownTokens::clean), one(2, KnownTokens::clean));
    EXPECT_NE(one(1, KnownTokens::noised), one(2, KnownTokens::noised));
}

TEST(engine_sampler, a_small_window_of_modulations_changes_nothing)
{
    const SamplingPlan p = plan(Sampler::ddpm, 9, {3, 2});
    const RegionInput region = patch(0, 30, 10);
    SamplerOptions small{{2}, 5};
    small.modulation_window = 2;
    EXPECT_EQ(run(p, small, {region}), run(p, {{2}, 5}, {region}));
}

TEST(engine_sampler, guides_the_steps_from_a_timestep_on)
{
    const std::vector<RegionInput> regions{patch(0, 50, 20), patch(40, 33, 0)};
    const SamplingPlan p = plan(Sampler::ddpm, 4, {2, 2}); // timesteps 999, 749, 499, 249
    const auto from = [&](double timestep) { return run(p, {{2, timestep}, 7}, regions); };
    const std::vector<float> some = from(500);
    EXPECT_EQ(from(250), from(499));
    EXPECT_EQ(from(0), run(p, {{2}, 7}, regions));
    EXPECT_EQ(from(1000), run(p, {{1}, 7}, regions));
    EXPECT_NE(some, from(0));
    EXPECT_NE(some, from(1000));
    const std::vector<float> alone = run(p, {{2, 500}, 7}, {regions[0]});
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), some.begin()));
}

TEST(engine_sampler, guides_the_steps_up_to_a_timestep)
{
    const std::vector<RegionInput> regions{patch(0, 50, 20)};
    const SamplingPlan p = plan(Sampler::ddpm, 4, {}); // timesteps 999, 749, 499, 249
    const auto between = [&](double from, double until) { return run(p, {{2, from, until}, 7}, regions); };
    EXPECT_EQ(between(0, 999), run(p, {{2}, 7}, regions));
    EXPECT_EQ(between(0, 998), between(0, 749));
    EXPECT_NE(between(0, 998), between(0, 999));
    EXPECT_EQ(between(300, 400), run(p, {{1}, 7}, regions));
    const auto backwards = TokenSampler::create(device(), transformer(), p, {{2, 500, 400}, 7});
    ASSERT_FALSE(backwards);
    EXPECT_EQ(backwards.error().code, ErrorCode::usage);
}

// with scale 0 a step is its unlabelled half: what a network of that radius makes of the same voxels without labels
TEST(engine_sampler, lets_cells_without_labels_see_none_beyond_the_guidance_radius)
{
    const SamplingPlan p = plan(Sampler::ddpm, 3, {});
    const RegionInput region = patch(0, 50, 0);
    RegionInput bare = region;
    TransformerConfig config = transformer().config(), narrow = config;
    bare.labels.assign(region.cells.size(), config.num_classes);
    const double radius = 2 * config.voxel_size;
    narrow.attention_radius = float(radius);
    const std::unique_ptr<Transformer> whole = std::move(*Transformer::random(device(), config, DType::f16)),
                                       near = std::move(*Transformer::random(device(), narrow, DType::f16));
    const auto unlabelled = [&](double r) { return run(p, {{0, 0, kLastTimestep, r}, 7}, {region}, *whole); };
    EXPECT_EQ(unlabelled(radius), run(p, {{1}, 7}, {bare}, *near));
    EXPECT_EQ(unlabelled(config.attention_radius), run(p, {{1}, 7}, {bare}, *whole));
    EXPECT_NE(unlabelled(radius), unlabelled(config.attention_radius));
    // the labelled half sees as far as ever
    EXPECT_EQ(run(p, {{1, 0, kLastTimestep, radius}, 7}, {region}, *whole), run(p, {{1}, 7}, {region}, *whole));
}

// a guided step and one that is not, each a run of its own that begins with what the one before left
TEST(engine_sampler, steps_that_are_guided_and_not_follow_each_other)
{
    const RegionInput region = patch(0, 30, 0);
    const SamplingPlan both = plan(Sampler::ddpm, 2, {});
    const auto part = [&](size_t first, size_t count, float scale, double from, const std::vector<float>& begin) {
        SamplingPlan p = both;
        p.rows = {both.rows.begin() + ptrdiff_t(first), both.rows.begin() + ptrdiff_t(first + count)};
        SamplerOptions options{{scale, from}, 0};
        options.noise = [=](size_t row, std::span<float> normals) {
            for (size_t i = 0; i < normals.size(); ++i)
                normals[i] = row == 0 && i < begin.size() ? begin[i] : float((i * 13) % 31) / 15.5f - 1;
        };
        return run(p, options, {region});
    };
    std::vector<float> noise(30 * size_t(transformer().config().channels()));
    for (size_t i = 0; i < noise.size(); ++i)
        noise[i] = float((i * 7) % 41) / 20.5f - 1;
    const std::vector<float> middle = part(0, 1, 3, 0, noise);
    EXPECT_EQ(part(0, 2, 3, 600, noise), part(1, 1, 1, 0, middle));
}

TEST(engine_sampler, the_seed_and_only_the_seed_changes_the_result)
{
    const SamplingPlan p = plan(Sampler::ddpm, 2, {});
    const RegionInput region = patch(0, 20, 0);
    const auto first = run(p, {{1}, 5}, {region});
    EXPECT_EQ(first, run(p, {{1}, 5}, {region}));
    EXPECT_NE(first, run(p, {{1}, 6}, {region}));
    EXPECT_NE(first, run(p, {{1}, 5ull << 32}, {region}));
}

TEST(engine_sampler, planned_memory_is_the_memory_in_use)
{
    const SamplingPlan p = plan(Sampler::ddpm, 2, {});
    for (const double from : {0., 600.}) {
        const uint64_t before = device().allocated_bytes();
        auto sampler = *TokenSampler::create(device(), transformer(), p, {{2, from}, 5});
        const uint64_t planned = *sampler->planned_bytes(2, 40);
        ASSERT_TRUE(sampler->run(std::vector<RegionInput>{patch(0, 40, 0), patch(50, 40, 0)}));
        EXPECT_EQ(device().allocated_bytes() - before, planned);
    }
}

} // namespace engine_sampler_test
} // namespace semrover
