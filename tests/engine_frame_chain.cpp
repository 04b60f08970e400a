// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a chain of frames whose pixels and latents stay on the device: the bytes are those of one that goes through the host
#include "engine/refine/frame_renderer.h"
#include "runtime/device/readback_ring.h"
#include "tests/golden_renderer.h"

#include <cmath>
#include <cstring>
#include <limits>

namespace semrover {
namespace engine_frame_chain_test {

const Path kModel = SEMROVER_SOURCE_DIR "/tests/golden/asd_rollout_tiny/model";
const LatentSize kSize = kOddSize;
constexpr uint32_t kFrames = 3;

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

struct Networks : GoldenRenderer {
    explicit Networks(DType precision) : GoldenRenderer(device(), "asd_rollout_tiny", 5, precision) {}

    std::unique_ptr<AsdRenderer> renderer() const
    {
        SchedulerConfig config;
        config.sampler = Sampler::ddim;
        config.clip_sample = false;
        AsdOptions options;
        options.guidance_scale = 2;
        return std::move(*AsdRenderer::create(device(), *unet, *plan_sampling(config, 3), {5, text}, kSize, options));
    }
    std::unique_ptr<LatentCodec> codec(CodecDirection direction) const
    {
        return std::move(*LatentCodec::create(device(), *vae, kSize, direction));
    }
};

std::vector<uint32_t> seen(uint32_t frame)
{
    std::vector<uint32_t> words(kSize.image_width * kSize.image_height);
    for (size_t i = 0; i < words.size(); ++i)
        words[i] = (uint32_t((i + frame * 77) * 2654435761u) >> 8) | (i * i % 7 < 4 ? 0xff000000u : 0);
    return words;
}

using Picture = std::vector<uint8_t>;

std::vector<Picture> through_the_host(const Networks& n)
{
    const auto encoder = n.codec(CodecDirection::encode), decoder = n.codec(CodecDirection::decode);
    const auto renderer = n.renderer();
    std::vector<Picture> frames;
    std::vector<float> previous;
    for (uint32_t f = 0; f < kFrames; ++f) {
        Picture color, visible;
        for (const uint32_t word : seen(f)) {
            color.insert(color.end(), {uint8_t(word), uint8_t(word >> 8), uint8_t(word >> 16)});
            visible.push_back(uint8_t(word >> 24));
        }
        const std::vector<float> buffer = *encoder->encode(floats_of_pixels(color));
        previous = *renderer->render({f, 0, buffer, block_shares(kSize, visible), previous});
        frames.push_back(pixels_of_floats(*decoder->decode(previous)));
    }
    return frames;
}

std::vector<Picture> on_the_device(const Networks& n)
{
    const auto encoder = n.codec(CodecDirection::encode), decoder = n.codec(CodecDirection::decode);
    const auto renderer = n.renderer();
    const auto copies = std::move(*CopyRing::create(device()));
    const auto ring = std::move(*ReadbackRing::create(device(), decoder->slots().bytes.bytes(), 2));
    const AsdSlots& ends = renderer->slots();
    std::vector<Picture> frames;
    for (uint32_t f = 0; f < kFrames; ++f) {
        EXPECT_TRUE(encoder->slots().seen.write(device(), seen(f)));
        EXPECT_TRUE(encoder->encode_seen());
        EXPECT_TRUE(copies->copy(encoder->slots().latent, ends.buffer));
        EXPECT_TRUE(copies->copy(encoder->slots().shares, ends.visible));
        EXPECT_TRUE(copies->copy(ends.latent, ends.previous));
        EXPECT_TRUE(renderer->begin(AsdStart{f, 0, f == 0}));
        while (!*renderer->step(1)) {
        }
        EXPECT_TRUE(renderer->end());
        EXPECT_TRUE(copies->copy(ends.latent, decoder->slots().latent));
        EXPECT_TRUE(decoder->decode_latent());
        EXPECT_TRUE(encoder->check());
        EXPECT_TRUE(decoder->check());
        EXPECT_TRUE(ring->read(decoder->slots().bytes, [&](std::span<const std::byte> bytes) -> Status {
            Picture& picture = frames.emplace_back(bytes.size());
            std::memcpy(picture.data(), bytes.data(), bytes.size());
            picture.resize(size_t(kSize.image_width) * kSize.image_height * 3);
            return {};
        }));
    }
    EXPECT_TRUE(ring->drain());
    return frames;
}

TEST(engine_frame_chain, on_the_device_has_the_bytes_of_one_through_the_host)
{
    for (DType precision : {DType::f32, DType::f16}) {
        const Networks networks(precision);
        const std::vector<Picture> host = through_the_host(networks), there = on_the_device(networks);
        ASSERT_EQ(host.size(), kFrames);
        EXPECT_NE(host[0], host[1]);
        EXPECT_EQ(host, there) << dtype_name(precision);
    }
}

// as a run of `refine` has it: networks and codecs come and go, latents stay
struct Job {
    RendererModel model;
    SamplingPlan plan;
    RendererWork work{kSize};

    Job()
    {
        model.unet_folder = kModel / "unet";
        model.vae_folder = kModel / "vae";
        model.unet = *parse_unet_config(*read_json(kModel / "unet" / "config.json"));
        model.vae = *parse_vae_config(*read_json(kModel / "vae" / "config.json"));
        model.conditioning_tokens = 5;
        for (size_t i = 0; i < 5 * model.unet.cross_attention_dim; ++i)
            model.conditioning.push_back(std::sin(float(i)));
        SchedulerConfig config;
        config.sampler = Sampler::ddim;
        config.clip_sample = false;
        plan = *plan_sampling(config, 3);
    }
    std::unique_ptr<FrameRenderer> renderer() const
    {
        AsdOptions options;
        options.guidance_scale = 2;
        auto networks = std::make_shared<LoadedNetworks>(device(), model, DType::f16);
        auto r = std::make_unique<FrameRenderer>(device(), networks, plan, options, MemoryPolicy::resident);
        EXPECT_TRUE(r->start(work, work));
        return r;
    }
};

// frame `f`, after the frame before it in the same renderer or a latent of it
Picture frame_of(FrameRenderer& r, uint32_t f)
{
    EXPECT_TRUE(r.begin_frame({f, 0, f == 0}));
    while (!*r.step(2)) {
    }
    EXPECT_TRUE(r.end_frame());
    const auto bytes = r.decode_latent();
    EXPECT_TRUE(bytes) << bytes.error().message;
    Picture picture = *bytes->read<uint8_t>(device());
    picture.resize(size_t(kSize.image_width) * kSize.image_height * 3);
    return picture;
}

TEST(engine_frame_chain, a_frame_renderer_keeps_latents_between_its_stages_and_frames)
{
    const Job job;
    const auto host = job.renderer(), there = job.renderer();
    std::vector<float> previous;
    for (uint32_t f = 0; f < kFrames; ++f) {
        Picture color, visible;
        for (const uint32_t word : seen(f)) {
            color.insert(color.end(), {uint8_t(word), uint8_t(word >> 8), uint8_t(word >> 16)});
            visible.push_back(uint8_t(word >> 24));
        }
        const std::vector<float> buffer = *host->encode(floats_of_pixels(color)), before = previous,
                                 shares = block_shares(kSize, visible);
        ASSERT_TRUE(host->begin({f, 0, buffer, shares, before}));
        while (!*host->step(1)) {
        }
        previous = *host->finish();
        const Picture expected = pixels_of_floats(*host->decode(previous));
        ASSERT_TRUE(there->encode_seen(seen(f)));
        EXPECT_EQ(frame_of(*there, f), expected) << "frame " << f;
        EXPECT_EQ(*there->denoiser()->slots().latent.read_rows(device(), kSize.pixels()), previous);
        // taken up by another, from what a folder holds
        const auto later = job.renderer();
        if (f > 0) {
            ASSERT_TRUE(later->use_previous(before));
        }
        ASSERT_TRUE(later->use_latent(buffer, shares));
        EXPECT_EQ(frame_of(*later, f), expected) << "frame " << f << ", taken up";
    }
}

TEST(engine_frame_chain, what_is_not_finite_is_told_as_on_the_host)
{
    const Networks networks(DType::f32);
    const auto decoder = networks.codec(CodecDirection::decode);
    std::vector<float> latent(kSize.pixels() * 4, 0.5f);
    latent[9] = std::numeric_limits<float>::quiet_NaN();
    ASSERT_TRUE(decoder->slots().latent.write_rows(device(), latent));
    ASSERT_TRUE(decoder->decode_latent());
    const Status status = decoder->check();
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::internal);
    EXPECT_EQ(status.error().message, decoder->decode(latent).error().message);
    EXPECT_TRUE(status.error().message.starts_with("the decoded frame holds ")) << status.error().message;
    EXPECT_TRUE(status.error().message.ends_with(": overflow; try --precision fp32")) << status.error().message;
}

} // namespace engine_frame_chain_test
} // namespace semrover
