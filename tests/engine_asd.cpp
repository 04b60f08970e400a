// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/deferred/frame_codec.h"
#include "engine/deferred/memory_plan.h"
#include "tests/support/golden_renderer.h"

#include <cmath>
#include <limits>

namespace semrover {
namespace engine_asd_test {

const LatentSize kSize = kOddSize;

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

const GoldenRenderer& networks()
{
    static const GoldenRenderer n(device(), "asd_rollout_tiny", 5);
    return n;
}

const Unet& unet()
{
    return *networks().unet;
}

const Vae& vae()
{
    return *networks().vae;
}

SamplingPlan plan(Sampler sampler = Sampler::ddim, int steps = 3)
{
    SchedulerConfig config;
    config.sampler = sampler;
    config.beta_schedule = BetaSchedule::scaled_linear;
    config.beta_start = 0.00085;
    config.beta_end = 0.012;
    config.clip_sample = false;
    return *plan_sampling(config, steps);
}

AsdOptions options(float guidance = 2.5f, uint64_t seed = 7)
{
    AsdOptions o;
    o.guidance_scale = guidance;
    o.seed = seed;
    return o;
}

const std::vector<float>& text()
{
    return networks().text;
}

std::unique_ptr<AsdRenderer> renderer(const AsdOptions& o = options(), const SamplingPlan& p = plan())
{
    auto made = AsdRenderer::create(device(), unet(), p, {5, text()}, kSize, o);
    EXPECT_TRUE(made) << made.error().message;
    return std::move(*made);
}

struct Scene {
    std::vector<float> buffer, visible;

    explicit Scene(uint32_t frame) : buffer(kSize.pixels() * 4), visible(kSize.pixels())
    {
        for (size_t i = 0; i < buffer.size(); ++i)
            buffer[i] = std::sin(float(i) * 0.7f + float(frame));
        for (size_t i = 0; i < visible.size(); ++i)
            visible[i] = float((i + frame) % 5) / 4;
    }
};

using Latent = std::vector<float>;

Latent render(AsdRenderer& r, uint32_t number, const Latent& previous = {}, uint32_t chain = 0)
{
    const Scene scene(number);
    auto latent = r.render({number, chain, scene.buffer, scene.visible, previous});
    EXPECT_TRUE(latent) << latent.error().message;
    return *latent;
}

TEST(engine_asd, a_chain_gives_the_same_bytes_again_and_from_a_stored_latent)
{
    for (Sampler sampler : {Sampler::ddim, Sampler::dpmpp_2m, Sampler::ddpm}) {
        const auto first = renderer(options(), plan(sampler)), second = renderer(options(), plan(sampler));
        const Latent a = render(*first, 0), b = render(*first, 1, a), c = render(*first, 2, b);
        EXPECT_EQ(c, render(*second, 2, b)) << sampler_name(sampler); // as if a run had gone on at frame 2
        EXPECT_EQ(b, render(*second, 1, a)) << sampler_name(sampler);
    }
}

TEST(engine_asd, frames_chains_seeds_and_what_came_before_change_the_latent)
{
    const auto r = renderer();
    const Latent base = render(*r, 3);
    const Scene scene(3);
    const auto variant = [&](uint32_t number, uint32_t chain, const Latent& previous) {
        return *r->render({number, chain, scene.buffer, scene.visible, previous});
    };
    EXPECT_EQ(base, variant(3, 0, {}));
    EXPECT_NE(base, variant(4, 0, {}));
    EXPECT_NE(base, variant(3, 1, {}));
    EXPECT_NE(base, variant(3, 0, base));
    EXPECT_NE(base, render(*renderer(options(2.5f, 8)), 3));
    // a first frame has no noise on the latent before it: a latent of zeros has
    EXPECT_NE(base, variant(3, 0, Latent(base.size(), 0.f)));
    AsdOptions quiet = options();
    quiet.previous_noise = 0;
    EXPECT_EQ(base, render(*renderer(quiet), 3, Latent(base.size(), 0.f)));
}

TEST(engine_asd, noise_follows_its_keys)
{
    const auto r = renderer();
    const Latent before = render(*r, 2);
    const Scene scene(3);
    std::vector<NoiseKey> keys(kSize.pixels());
    const auto with_keys = [&](uint32_t number) {
        return *r->render({number, 0, scene.buffer, scene.visible, before, keys});
    };
    for (uint32_t i = 0; i < keys.size(); ++i)
        keys[i] = {i, 3};
    EXPECT_EQ(with_keys(3), render(*r, 3, before)); // each pixel its own
    EXPECT_EQ(with_keys(4), render(*r, 3, before)); // nothing else of a frame decides its noise
    std::swap(keys[0], keys[20]);
    EXPECT_NE(with_keys(3), render(*r, 3, before));
}

TEST(engine_asd, guidance_of_one_is_the_conditional_half_alone)
{
    // just above 1 both halves run, and the unconditional one counts for nearly nothing
    const Latent alone = render(*renderer(options(1)), 0), both = render(*renderer(options(1.000001f)), 0);
    double largest = 0, scale = 0;
    for (size_t i = 0; i < alone.size(); ++i) {
        largest = std::max(largest, double(std::abs(alone[i] - both[i])));
        scale = std::max(scale, double(std::abs(alone[i])));
    }
    EXPECT_LT(largest, 1e-5 * scale); // measured 3e-7
    EXPECT_NE(alone, render(*renderer(options(2)), 0));
}

TEST(engine_asd, planned_memory_is_the_memory_in_use)
{
    (void)unet();
    (void)vae();
    const SamplingPlan p = plan();
    for (float guidance : {1.f, 2.5f}) {
        const uint64_t before = device().allocated_bytes();
        const auto bytes = AsdRenderer::planned_bytes(device().limits(), unet(), p, 5, kSize, guidance);
        ASSERT_TRUE(bytes) << bytes.error().message;
        device().reset_peak();
        const auto r = renderer(options(guidance), p);
        render(*r, 0);
        EXPECT_EQ(device().allocated_bytes() - before, bytes->bytes());
        EXPECT_EQ(device().peak_bytes() - before, bytes->bytes());
    }
    const uint64_t before = device().allocated_bytes();
    const auto encoded = *FrameEncoder::planned_bytes(device().limits(), vae(), kSize),
               decoded = *FrameDecoder::planned_bytes(device().limits(), vae(), kSize, 1);
    const auto encoder = *FrameEncoder::create(device(), vae(), kSize, false);
    EXPECT_EQ(device().allocated_bytes() - before, encoded.bytes());
    const auto decoder = *FrameDecoder::create(device(), vae(), kSize, 1);
    EXPECT_EQ(device().allocated_bytes() - before, encoded.bytes() + decoded.bytes());
}

TEST(engine_asd, a_latent_with_nan_is_an_error_and_no_picture)
{
    const auto r = renderer();
    Scene scene(0);
    scene.buffer[9] = std::numeric_limits<float>::quiet_NaN();
    const auto latent = r->render({0, 0, scene.buffer, scene.visible, {}});
    ASSERT_FALSE(latent);
    EXPECT_EQ(latent.error().code, ErrorCode::internal);
    EXPECT_NE(latent.error().message.find("nan"), std::string::npos) << latent.error().message;
    const auto decoder = *FrameDecoder::create(device(), vae(), kSize, 1);
    const auto image = decoder->decode(scene.buffer);
    ASSERT_FALSE(image);
    EXPECT_EQ(image.error().code, ErrorCode::internal);
}

TEST(engine_asd, stops_when_the_callback_says_so)
{
    const auto r = renderer(options(), plan(Sampler::ddim, 6));
    const Scene scene(0);
    size_t calls = 0;
    const auto latent = r->render({0, 0, scene.buffer, scene.visible, {}}, [&](size_t, size_t) { return ++calls < 2; });
    ASSERT_FALSE(latent);
    EXPECT_EQ(latent.error().code, ErrorCode::interrupted);
    EXPECT_EQ(calls, 2u);
}

TEST(engine_asd, a_network_of_other_channels_is_refused)
{
    UnetConfig config = unet().config();
    config.in_channels = 4;
    const auto plain = Unet::plan(config, DType::f16);
    const auto refused = AsdRenderer::create(device(), *plain, plan(), {5, text()}, kSize, options());
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::bad_input);
    const auto guided = AsdRenderer::create(device(), unet(), plan(), {5, text()}, kSize, options(-1));
    ASSERT_FALSE(guided);
    EXPECT_EQ(guided.error().code, ErrorCode::usage);
}

TEST(engine_frame_codec, a_picture_that_does_not_fill_its_blocks_is_continued_at_its_edges)
{
    const uint32_t w = kSize.image_width, h = kSize.image_height;
    std::vector<float> image, padded;
    const auto value = [](uint32_t x, uint32_t y, uint32_t c) { return std::sin(float(x + 3 * y) / 20 + float(c)); };
    for (uint32_t y = 0; y < 40; ++y)
        for (uint32_t x = 0; x < 56; ++x)
            for (uint32_t c = 0; c < 3; ++c) {
                padded.push_back(value(std::min(x, w - 1), std::min(y, h - 1), c));
                if (x < w && y < h)
                    image.push_back(value(x, y, c));
            }
    const auto odd = *FrameEncoder::create(device(), vae(), kSize, false);
    const auto even = *FrameEncoder::create(device(), vae(), {56, 40, 8}, false);
    const auto latent = odd->encode(image);
    ASSERT_TRUE(latent) << latent.error().message;
    EXPECT_EQ(*latent, *even->encode(padded));
    const auto cut = (*FrameDecoder::create(device(), vae(), kSize, 1))->decode(*latent);
    const auto whole = (*FrameDecoder::create(device(), vae(), {56, 40, 8}, 1))->decode(*latent);
    ASSERT_EQ(cut->size(), size_t(w) * h * 3);
    for (uint32_t y = 0; y < h; ++y)
        for (uint32_t i = 0; i < w * 3; ++i)
            ASSERT_EQ((*cut)[size_t(y) * w * 3 + i], (*whole)[size_t(y) * 56 * 3 + i]);
}

TEST(engine_frame_codec, visibility_is_the_share_of_a_block)
{
    const LatentSize size{10, 8, 4};
    std::vector<uint8_t> visible(80, 0);
    for (uint32_t y = 0; y < 8; ++y)
        for (uint32_t x = 0; x < 10; ++x)
            visible[y * 10 + x] = x == 9 || (x < 4 && y < 2) ? 255 : 0;
    // columns 8 and 9, the second three times
    EXPECT_EQ(block_shares(size, visible), (std::vector<float>{0.5f, 0, 0.75f, 0, 0, 0.75f}));
}

TEST(engine_memory_plan, takes_the_first_policy_that_fits_and_says_what_each_needs)
{
    RendererBytes parts;
    parts.unet = 1000;
    parts.vae = 100;
    // the programs of all parts share an arena; one network at a time has its own
    parts.sizes = {{{kSize}, {5, {{65}}}, {10, {{50, 6}}}, {15, {{70}}}, {10, {{50}}}}};
    EXPECT_EQ(parts.peak(MemoryPolicy::resident), 1206u);
    EXPECT_EQ(parts.peak(MemoryPolicy::staged), 1060u);
    EXPECT_EQ(&parts.of({kSize}), &parts.sizes[0]);
    EXPECT_EQ(plan_memory(parts, 5, 0)->policy, MemoryPolicy::resident);
    EXPECT_EQ(plan_memory(parts, 5, 1211)->bytes, 1211u);
    EXPECT_EQ(plan_memory(parts, 5, 1210)->policy, MemoryPolicy::staged);
    const auto refused = plan_memory(parts, 5, 1064);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::out_of_memory);
    for (const char* number : {"1211 bytes resident", "1065 bytes staged", "1064"})
        EXPECT_NE(refused.error().message.find(number), std::string::npos) << refused.error().message;
    // only latents are left to decode: the UNet is not needed
    parts.unet = 0;
    parts.sizes = {{{kSize, false, false, true}, {}, {}, {20, {{70}}}, {}}};
    EXPECT_EQ(plan_memory(parts, 0, 0)->bytes, 190u);
}

} // namespace engine_asd_test
} // namespace semrover
