// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/refine/video_decoder.h"
#include "engine/refine/vsd.h"
#include "runtime/base/json.h"
#include "tests/says.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_vsd_test {

const Path kModel = SEMROVER_SOURCE_DIR "/tests/golden/vsd_window_tiny/model";
const LatentSize kSize{51, 38, 8}; // a latent of 7 x 5 whose last blocks are not full
constexpr uint32_t kFrames = 3;
const std::vector<float> kAdded{6, 127, 0.02f};

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

const Unet& unet()
{
    static const std::unique_ptr<Unet> network =
        std::move(*Unet::load(device(), *parse_video_unet_config(*read_json(kModel / "unet" / "config.json")),
                              *Checkpoint::open_folder(kModel / "unet", Checkpoint::Network::unet), DType::f16));
    return *network;
}

const Vae& vae()
{
    static const std::unique_ptr<Vae> network =
        std::move(*Vae::load(device(), *parse_video_vae_config(*read_json(kModel / "vae" / "config.json")),
                             *Checkpoint::open_folder(kModel / "vae", Checkpoint::Network::vae), DType::f16));
    return *network;
}

SamplingPlan plan()
{
    SchedulerConfig config;
    config.sampler = Sampler::euler;
    config.beta_schedule = BetaSchedule::scaled_linear;
    config.beta_start = 0.00085;
    config.beta_end = 0.012;
    config.prediction = Prediction::v_prediction;
    config.clip_sample = false;
    config.use_karras_sigmas = config.continuous_timesteps = true;
    config.sigma_min = 0.002;
    config.sigma_max = 700;
    return *plan_sampling(config, 2);
}

VsdOptions options(float last_guidance = 2.5f, uint64_t seed = 7)
{
    VsdOptions o;
    o.last_guidance = last_guidance;
    o.seed = seed;
    return o;
}

// of two tokens, which may differ
const std::vector<float>& text()
{
    static const std::vector<float> values = [] {
        std::vector<float> v(2 * unet().config().cross_attention_dim);
        for (size_t i = 0; i < v.size(); ++i)
            v[i] = std::sin(float(i));
        return v;
    }();
    return values;
}

std::unique_ptr<VsdRenderer> renderer(const VsdOptions& o = options(), std::vector<float> added = kAdded)
{
    auto made = VsdRenderer::create(device(), unet(), plan(), {{2, text()}, added}, kSize, kFrames, o);
    EXPECT_TRUE(made) << made.error().message;
    return std::move(*made);
}

struct Window {
    std::vector<float> buffers, visible;

    Window() : buffers(kFrames * kSize.pixels() * 4), visible(kFrames * kSize.pixels())
    {
        for (size_t i = 0; i < buffers.size(); ++i)
            buffers[i] = std::sin(float(i) * 0.7f);
        for (size_t i = 0; i < visible.size(); ++i)
            visible[i] = float(i % 5) / 4;
    }
};

std::vector<float> render(VsdRenderer& r, uint32_t number = 0, uint32_t chain = 0)
{
    const Window window;
    auto latents = r.render({number, chain, window.buffers, window.visible});
    EXPECT_TRUE(latents) << latents.error().message;
    return *latents;
}

TEST(engine_vsd, a_window_gives_the_same_bytes_again_and_others_for_another_seed_window_camera_or_number)
{
    const auto r = renderer();
    const std::vector<float> base = render(*r);
    ASSERT_EQ(base.size(), size_t(kFrames) * kSize.pixels() * 4);
    EXPECT_EQ(base, render(*renderer()));
    EXPECT_NE(base, render(*r, 1));
    EXPECT_NE(base, render(*r, 0, 1));
    EXPECT_EQ(base, render(*r));
    EXPECT_NE(base, render(*renderer(options(2.5f, 8))));
    EXPECT_NE(base, render(*renderer(options(), {7, 127, 0.02f})));
}

// the first frame's guidance is 1 with either; it sees the other frames, whose guidance differs, from the second step
// on
TEST(engine_vsd, guidance_of_one_needs_no_unconditional_half)
{
    const std::vector<float> guided = render(*renderer(options(3))), plain = render(*renderer(options(1)));
    EXPECT_NE(guided, plain);
    VsdOptions almost = options(1);
    almost.first_guidance = std::nextafter(1.f, 2.f);
    const std::vector<float> both = render(*renderer(almost));
    for (size_t i = 0; i < plain.size(); ++i)
        ASSERT_NEAR(plain[i], both[i], 1e-3 * (1 + std::abs(plain[i]))) << i;
}

TEST(engine_vsd, stops_where_the_callback_says)
{
    const auto r = renderer();
    const std::vector<float> base = render(*r);
    const Window window;
    size_t calls = 0;
    const auto stopped = r->render({0, 0, window.buffers, window.visible}, [&](size_t done, size_t total) {
        EXPECT_EQ(done, ++calls);
        EXPECT_EQ(total, 2u);
        return false;
    });
    EXPECT_TRUE(says(stopped, "interrupted"));
    EXPECT_EQ(calls, 1u);
    EXPECT_EQ(base, render(*r));
}

TEST(engine_vsd, memory_is_what_was_planned)
{
    const auto planned = VsdRenderer::planned_bytes(device().limits(), unet(), plan(), 2, kSize, kFrames, options());
    ASSERT_TRUE(planned) << planned.error().message;
    const auto r = renderer();
    (void)render(*r);
    EXPECT_EQ(planned->programs, r->arena_bytes());
    EXPECT_GT(planned->state, 0u);
}

TEST(engine_vsd, refuses_networks_and_options_that_do_not_fit)
{
    const auto create = [](const Unet& network, const std::vector<float>& added, uint32_t frames, const VsdOptions& o) {
        return VsdRenderer::create(device(), network, plan(), {{2, text()}, added}, kSize, frames, o);
    };
    EXPECT_TRUE(says(create(unet(), kAdded, 65, options()), "a window of 65 frames, expected 1 to 64"));
    EXPECT_TRUE(says(create(unet(), kAdded, 0, options()), "a window of 0 frames"));
    EXPECT_TRUE(says(create(unet(), {6}, kFrames, options()), "takes 3 numbers with a video, not 1"));
    EXPECT_TRUE(says(create(unet(), kAdded, kFrames, options(-1)), "guidance from 1 to -1"));
    UnetConfig config = unet().config();
    config.in_channels = 8;
    const auto other = Unet::plan(config, DType::f16, device().limits());
    EXPECT_TRUE(says(create(*other, kAdded, kFrames, options()), "takes 8 channels, the video renderer gives it 9"));
    const auto image = Unet::plan({}, DType::f16, device().limits());
    EXPECT_TRUE(says(create(*image, kAdded, kFrames, options()), "one of single images"));
}

// frames that are not whole blocks are cut; a video of other frames decodes to another first frame
TEST(engine_vsd, decodes_the_frames_of_a_video_together)
{
    const auto decoder = VideoDecoder::create(device(), vae(), kSize, kFrames);
    ASSERT_TRUE(decoder) << decoder.error().message;
    std::vector<float> latents(kFrames * kSize.pixels() * 4);
    for (size_t i = 0; i < latents.size(); ++i)
        latents[i] = std::cos(float(i) * 0.3f) * 0.2f;
    const auto images = (*decoder)->decode(latents);
    ASSERT_TRUE(images) << images.error().message;
    const size_t image = 51 * 38 * 3;
    ASSERT_EQ(images->size(), kFrames * image);
    latents.back() += 1;
    const auto changed = (*decoder)->decode(latents);
    ASSERT_TRUE(changed);
    EXPECT_FALSE(std::equal(images->begin(), images->begin() + image, changed->begin()));
    latents[5] = NAN;
    EXPECT_TRUE(says((*decoder)->decode(latents), "the decoded video holds"));
    const auto planned = VideoDecoder::planned_bytes(device().limits(), vae(), kSize, kFrames);
    ASSERT_TRUE(planned);
    EXPECT_GT(*planned, 0u);
}

} // namespace engine_vsd_test
} // namespace semrover
