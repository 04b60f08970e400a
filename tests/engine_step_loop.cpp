// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// runs of tokens and of frames, stopped between rows: the bytes are those of the uninterrupted run
#include "engine/deferred/asd.h"
#include "engine/voxfield/token_sampler.h"
#include "runtime/base/json.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_step_loop_test {

const Path kGolden = SEMROVER_SOURCE_DIR "/tests/golden";
const LatentSize kSize{51, 38, 8};

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

const Transformer& transformer()
{
    static const std::unique_ptr<Transformer> t =
        std::move(*Transformer::load(device(), kGolden / "sampling_ddpm" / "model", DType::f16));
    return *t;
}

const Unet& unet()
{
    static const Path folder = kGolden / "asd_rollout_tiny" / "model" / "unet";
    static const std::unique_ptr<Unet> network =
        std::move(*Unet::load(device(), *parse_unet_config(*read_json(folder / "config.json")),
                              *Checkpoint::open_folder(folder, Checkpoint::Network::unet), DType::f16));
    return *network;
}

SamplingPlan plan_of(Sampler sampler, int steps, const RepaintOptions& repaint = {})
{
    SchedulerConfig config;
    config.sampler = sampler;
    config.prediction = repaint.jump_length ? Prediction::sample : Prediction::epsilon;
    config.clip_sample = repaint.jump_length != 0;
    return *plan_sampling(config, steps, repaint);
}

// two regions of tokens, under jumps that leave the window of modulations either way
struct TokenRun {
    SamplingPlan plan = plan_of(Sampler::ddpm, 5, {2, 2});
    std::vector<RegionInput> regions{region(0, 20), region(40, 9)};
    uint64_t seed = 5;

    static RegionInput region(int32_t at, uint32_t cells)
    {
        RegionInput r;
        const size_t channels = transformer().config().channels();
        for (uint32_t i = 0; i < cells; ++i) {
            r.cells.push_back({at + int32_t(i % 5), int32_t(i / 5), 0});
            r.labels.push_back(i % 20);
            r.known.push_back(i % 4 == 0);
        }
        for (size_t i = 0; i < cells * channels; ++i)
            r.fixed.push_back(float((i * 7) % 201) / 100.f - 1);
        return r;
    }
    std::unique_ptr<TokenSampler> make() const
    {
        SamplerOptions options{{2.5f, 500}, seed};
        options.modulation_window = 2;
        return std::move(*TokenSampler::create(device(), transformer(), plan, options));
    }
    Status begin(TokenSampler& s) const { return s.begin(regions); }
    static size_t done(const TokenSampler& s) { return s.rows_done(); }
    static size_t rows(const TokenSampler& s) { return s.rows(); }
};

// a frame that follows another
struct FrameRun {
    SamplingPlan plan = plan_of(Sampler::dpmpp_2m, 4);
    uint64_t seed = 5;
    std::vector<float> text = wave(5 * unet().config().cross_attention_dim, 1), buffer = wave(kSize.pixels() * 4, 0.7f),
                       previous = wave(kSize.pixels() * 4, 0.3f), visible = std::vector<float>(kSize.pixels(), 0.5f);
    DenoiserWindow frame{3, 0, buffer, visible, previous};

    static std::vector<float> wave(size_t count, float step)
    {
        std::vector<float> v(count);
        for (size_t i = 0; i < count; ++i)
            v[i] = std::sin(float(i) * step);
        return v;
    }
    std::unique_ptr<AsdRenderer> make() const
    {
        AsdOptions options;
        options.guidance_scale = 2.5f;
        options.seed = seed;
        return std::move(*AsdRenderer::create(device(), unet(), plan, {5, text}, kSize, options));
    }
    Status begin(AsdRenderer& r) const { return r.begin(frame); }
    static size_t done(const AsdRenderer& r) { return r.steps_done(); }
    static size_t rows(const AsdRenderer& r) { return r.steps(); }
};

template <typename Kind>
class engine_step_loop : public ::testing::Test {
  public:
    Kind run;

    // the rest of a run that has begun, that many submits at a time
    template <typename Sampler>
    std::vector<float> rest(Sampler& s, size_t submits)
    {
        for (bool done = false; !done;) {
            const auto more = s.step(submits);
            EXPECT_TRUE(more) << more.error().message;
            done = !more || *more;
        }
        auto result = s.finish();
        EXPECT_TRUE(result) << result.error().message;
        return *result;
    }
    std::vector<float> uninterrupted()
    {
        const auto s = run.make();
        EXPECT_TRUE(run.begin(*s));
        return rest(*s, ~size_t(0));
    }
};

using Runs = ::testing::Types<TokenRun, FrameRun>;
TYPED_TEST_SUITE(engine_step_loop, Runs);

TYPED_TEST(engine_step_loop, gives_the_same_bytes_however_many_rows_are_submitted_at_a_time)
{
    const std::vector<float> whole = this->uninterrupted();
    const auto s = this->run.make();
    for (size_t submits : {1, 2, 3}) {
        ASSERT_TRUE(this->run.begin(*s));
        EXPECT_EQ(this->run.done(*s), 0u);
        EXPECT_EQ(this->rest(*s, submits), whole) << submits << " at a time";
        EXPECT_EQ(this->run.done(*s), this->run.rows(*s));
    }
}

TYPED_TEST(engine_step_loop, stopped_after_any_row_the_next_run_is_as_if_there_had_been_none)
{
    const std::vector<float> whole = this->uninterrupted();
    const auto s = this->run.make();
    for (size_t row = 0; row <= this->run.rows(*s); ++row) {
        ASSERT_TRUE(this->run.begin(*s));
        for (size_t i = 0; i < row; ++i)
            ASSERT_EQ(*s->step(1), i + 1 == this->run.rows(*s));
        ASSERT_TRUE(s->cancel());
    }
    ASSERT_TRUE(this->run.begin(*s));
    EXPECT_EQ(this->rest(*s, 1), whole);
}

TEST(engine_step_loop_of_two, in_turns_on_one_device_disturb_each_other_in_nothing)
{
    const TokenRun tokens;
    const FrameRun frame;
    const auto sampler = tokens.make(), alone = tokens.make();
    const auto renderer = frame.make(), lonely = frame.make();
    ASSERT_TRUE(tokens.begin(*alone));
    ASSERT_TRUE(*alone->step(~size_t(0)));
    const std::vector<float> points = *alone->finish();
    const std::vector<float> latent = *lonely->render(frame.frame);
    ASSERT_TRUE(tokens.begin(*sampler));
    ASSERT_TRUE(frame.begin(*renderer));
    bool first = false, second = false;
    while (!first || !second) {
        if (!first)
            first = *sampler->step(1);
        if (!second)
            second = *renderer->step(1);
    }
    EXPECT_EQ(*sampler->finish(), points);
    EXPECT_EQ(*renderer->finish(), latent);
}

TEST(engine_step_loop_of_two, a_step_without_a_run_is_the_callers_mistake)
{
    const TokenRun tokens;
    const auto sampler = tokens.make();
    EXPECT_DEATH((void)sampler->step(1), "a step of a run that has not begun");
    ASSERT_TRUE(tokens.begin(*sampler));
    EXPECT_DEATH((void)sampler->finish(), "a run is finished after 0 of ");
    ASSERT_TRUE(sampler->cancel());
    EXPECT_DEATH((void)sampler->step(1), "a step of a run that has not begun, or has ended");
}

} // namespace engine_step_loop_test
} // namespace semrover
