// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/deferred/frame_codec.h"
#include "engine/deferred/vsd.h"
#include "tests/support/golden_renderer.h"
#include "tests/support/says.h"

#include <cmath>
#include <limits>

namespace semrover {
namespace engine_vsd_test {

const LatentSize kSize = kOddSize;
constexpr uint32_t kFrames = 3;
const std::vector<float> kAdded{6, 127, 0.02f};

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

const GoldenRenderer& networks()
{
    static const GoldenRenderer n(device(), "vsd_window_tiny", 2);
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

const std::vector<float>& text()
{
    return networks().text;
}

std::unique_ptr<VsdRenderer> renderer(const VsdOptions& o = options(), std::vector<float> added = kAdded)
{
    auto made = VsdRenderer::create(device(), unet(), plan(), {2, text(), added}, kSize, kFrames, o);
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

TEST(engine_vsd, halves_one_after_the_other_give_the_same_bytes_in_less_memory)
{
    VsdOptions apart = options();
    apart.halves_apart = true;
    EXPECT_EQ(render(*renderer()), render(*renderer(apart)));
    DeviceLimits limits = device().limits();
    for (const bool side_by_side : {false, true}) { // as on a GPU
        limits.side_by_side = side_by_side;
        const auto bytes = [&](const VsdOptions& o) {
            return VsdRenderer::planned_bytes(limits, unet(), plan(), 2, kSize, kFrames, o)->arena.bytes();
        };
        EXPECT_LT(bytes(apart), bytes(options()) * 7 / 10);
    }
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

// a window whose first frames are given
std::vector<float> render_known(VsdRenderer& r, std::span<const float> known, uint32_t number = 0)
{
    const Window window;
    auto latents = r.render({number, 0, window.buffers, window.visible, known});
    EXPECT_TRUE(latents) << latents.error().message;
    return *latents;
}

TEST(engine_vsd, known_frames_leave_as_they_came_and_change_the_others)
{
    const auto r = renderer();
    const std::vector<float> free = render(*r);
    const size_t frame = kSize.pixels() * 4;
    std::vector<float> known(2 * frame);
    for (size_t i = 0; i < known.size(); ++i)
        known[i] = std::cos(float(i) * 0.1f);
    const std::vector<float> held = render_known(*r, known);
    EXPECT_TRUE(std::equal(known.begin(), known.end(), held.begin()));
    EXPECT_FALSE(
        std::equal(held.begin() + std::ptrdiff_t(2 * frame), held.end(), free.begin() + std::ptrdiff_t(2 * frame)));
    // all of them: nothing is left to make
    known.resize(kFrames * frame, 0.5f);
    EXPECT_EQ(render_known(*r, known), known);
    EXPECT_EQ(free, render(*r)); // and the next window knows nothing of it
}

// In the first step noise hides everything: what the network says wrongly of the known frame is added to the next frame
// by 0.9, to the one after it by 0.9 squared.
TEST(engine_vsd, what_known_frames_are_off_by_corrects_the_others)
{
    const size_t frame = kSize.pixels() * 4;
    const std::vector<float> known(frame, 0.25f);
    const Window window;
    VsdOptions o = options(1);
    const auto first_step = [&](VsdRenderer& r) {
        EXPECT_TRUE(r.begin({0, 0, window.buffers, window.visible, known}));
        EXPECT_FALSE(*r.step(1));
        EXPECT_TRUE(r.cancel());
        return *r.state();
    };
    const std::vector<float> held = first_step(*renderer(o));
    o.correlation = 0.9f;
    const auto r = renderer(o);
    const std::vector<float> corrected = first_step(*r);
    EXPECT_TRUE(std::equal(held.begin(), held.begin() + std::ptrdiff_t(frame), corrected.begin()));
    double largest = 0;
    for (size_t i = frame; i < 2 * frame; ++i) {
        const double next = corrected[i] - held[i], after = corrected[i + frame] - held[i + frame];
        largest = std::max(largest, std::abs(next));
        ASSERT_NEAR(after, 0.9 * next, 1e-3 * (1 + std::abs(next))) << i;
    }
    EXPECT_GT(largest, 0.1);
    EXPECT_EQ(render(*r), render(*renderer(options(1)))); // where nothing is known it changes nothing
    o.correlation = 1;
    EXPECT_TRUE(says(VsdRenderer::create(device(), unet(), plan(), {2, text(), kAdded}, kSize, kFrames, o),
                     "a correlation of 1 between frames"));
}

// the first state, and every next one, are what is known plus sigma times the frame's own noise
TEST(engine_vsd, the_network_sees_known_frames_with_the_noise_that_they_began_with)
{
    const size_t frame = kSize.pixels() * 4;
    VsdOptions o = options(1);
    std::vector<float> given(kFrames * frame);
    for (size_t i = 0; i < given.size(); ++i)
        given[i] = std::sin(float(i) * 1.3f);
    o.noise = [&](uint32_t, std::span<float> noise) { std::ranges::copy(given, noise.begin()); };
    const auto r = renderer(o);
    const std::vector<float> known(frame, 0.25f);
    const std::vector<float> base = render_known(*r, known);
    given[7] += 1; // of the known frame: the others see it
    const std::vector<float> other = render_known(*r, known);
    EXPECT_TRUE(std::equal(known.begin(), known.end(), other.begin()));
    EXPECT_NE(base, other);
}

TEST(engine_vsd, noise_follows_its_keys)
{
    const auto r = renderer();
    const Window window;
    std::vector<NoiseKey> keys;
    for (uint32_t f = 0; f < kFrames; ++f)
        for (uint32_t i = 0; i < kSize.pixels(); ++i)
            keys.push_back({i, 3 + f});
    const auto with_keys = [&](uint32_t number) {
        return *r->render({number, 0, window.buffers, window.visible, {}, keys});
    };
    EXPECT_EQ(with_keys(3), render(*r, 3)); // each pixel its own
    EXPECT_EQ(with_keys(4), render(*r, 3)); // nothing else of a window decides its noise
    std::swap(keys[0], keys[kSize.pixels() + 20]);
    EXPECT_NE(with_keys(3), render(*r, 3));
}

// what a frame has of noise does not depend on which window it is in
TEST(engine_vsd, a_frame_keeps_its_noise_from_window_to_window)
{
    const auto r = renderer(options(1));
    const Window window;
    const size_t frame = kSize.pixels() * 4;
    const auto first_step = [&](uint32_t number) { // nearly all noise yet: sigma is 700
        EXPECT_TRUE(r->begin({number, 0, window.buffers, window.visible, std::vector<float>(kFrames * frame, 0.f)}));
        EXPECT_FALSE(*r->step(1));
        EXPECT_TRUE(r->cancel());
        return *r->state();
    };
    const std::vector<float> a = first_step(0), b = first_step(1);
    ASSERT_EQ(a.size(), kFrames * frame);
    EXPECT_TRUE(std::equal(a.begin() + std::ptrdiff_t(frame), a.end(), b.begin()));
    EXPECT_FALSE(std::equal(a.begin(), a.begin() + std::ptrdiff_t(frame), b.begin()));
}

TEST(engine_vsd, memory_is_what_was_planned)
{
    (void)networks();
    for (const auto& [guidance, apart] : {std::pair{1.f, false}, {1.f, true}, {2.5f, false}, {2.5f, true}}) {
        VsdOptions o = options(guidance);
        o.halves_apart = apart;
        const uint64_t before = device().allocated_bytes();
        const auto planned = VsdRenderer::planned_bytes(device().limits(), unet(), plan(), 2, kSize, kFrames, o);
        ASSERT_TRUE(planned) << planned.error().message;
        device().reset_peak();
        const auto r = renderer(o);
        (void)render(*r);
        EXPECT_EQ(device().allocated_bytes() - before, planned->bytes());
        EXPECT_EQ(device().peak_bytes() - before, planned->bytes());
    }
    const uint64_t before = device().allocated_bytes();
    const auto decoder = FrameDecoder::create(device(), vae(), kSize, kFrames);
    ASSERT_TRUE(decoder) << decoder.error().message;
    EXPECT_EQ(device().allocated_bytes() - before,
              FrameDecoder::planned_bytes(device().limits(), vae(), kSize, kFrames)->bytes());
}

TEST(engine_vsd, a_latent_with_nan_is_an_error_and_names_the_element)
{
    const auto r = renderer();
    Window window;
    window.buffers[kSize.pixels() * 4 + 9] = std::numeric_limits<float>::quiet_NaN();
    const auto latents = r->render({0, 0, window.buffers, window.visible});
    ASSERT_FALSE(latents);
    EXPECT_EQ(latents.error().code, ErrorCode::internal);
    EXPECT_TRUE(latents.error().message.starts_with("the denoised latent holds ")) << latents.error().message;
}

TEST(engine_vsd, refuses_networks_and_options_that_do_not_fit)
{
    const auto create = [](const Unet& network, const std::vector<float>& added, uint32_t frames, const VsdOptions& o) {
        return VsdRenderer::create(device(), network, plan(), {2, text(), added}, kSize, frames, o);
    };
    EXPECT_TRUE(says(create(unet(), kAdded, 65, options()), "a window of 65 frames, expected 1 to 64"));
    EXPECT_TRUE(says(create(unet(), kAdded, 0, options()), "a window of 0 frames"));
    EXPECT_TRUE(says(create(unet(), {6}, kFrames, options()), "takes 3 numbers with a video, not 1"));
    EXPECT_TRUE(says(create(unet(), kAdded, kFrames, options(-1)), "guidance scale -1 is not in 0..1000"));
    UnetConfig config = unet().config();
    config.in_channels = 8;
    const auto other = Unet::plan(config, DType::f16);
    EXPECT_TRUE(says(create(*other, kAdded, kFrames, options()), "takes 8 channels, the video renderer gives it 9"));
    const auto image = Unet::plan({}, DType::f16);
    EXPECT_TRUE(says(create(*image, kAdded, kFrames, options()), "one of single images"));
}

// frames that are not whole blocks are cut; a video of other frames decodes to another first frame
TEST(engine_vsd, decodes_the_frames_of_a_video_together)
{
    const auto decoder = FrameDecoder::create(device(), vae(), kSize, kFrames);
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
    // the same as bytes
    ASSERT_TRUE((*decoder)->decode_bytes(latents));
    for (uint32_t f = 0; f < kFrames; ++f) {
        const auto first = changed->begin() + std::ptrdiff_t(f * image);
        std::vector<uint8_t> bytes = *(*decoder)->bytes(f).read<uint8_t>(device());
        bytes.resize(image);
        for (size_t i = 0; i < image; ++i)
            ASSERT_EQ(bytes[i], std::lround(std::clamp((first[std::ptrdiff_t(i)] + 1) * 127.5f, 0.f, 255.f))) << f;
    }
    latents[5] = NAN;
    EXPECT_TRUE(says((*decoder)->decode(latents), "the decoded video holds"));
}

} // namespace engine_vsd_test
} // namespace semrover
