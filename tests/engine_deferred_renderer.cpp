// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// frames of cameras, from splat buffers in memory: the bytes are those of encoder, denoiser and decoder by hand
#include "engine/deferred/deferred_renderer.h"
#include "tests/support/golden_renderer.h"

#include <cmath>
#include <limits>

namespace semrover {
namespace engine_deferred_renderer_test {

const Path kModel = SEMROVER_SOURCE_DIR "/tests/golden/asd_rollout_tiny/model";
const LatentSize kSize = kOddSize;
constexpr uint32_t kFrames = 3, kPixels = 51 * 38;

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

RendererModel golden_model()
{
    RendererModel model;
    model.unet_folder = kModel / "unet";
    model.vae_folder = kModel / "vae";
    model.unet = *parse_unet_config(*read_json(kModel / "unet" / "config.json"));
    model.vae = *parse_vae_config(*read_json(kModel / "vae" / "config.json"));
    model.conditioning_tokens = 5;
    for (size_t i = 0; i < 5 * model.unet.cross_attention_dim; ++i)
        model.conditioning.push_back(std::sin(float(i)));
    model.scheduler.sampler = Sampler::ddim;
    model.scheduler.clip_sample = false;
    return model;
}

RendererSettings settings()
{
    RendererOptions options;
    options.steps = 3;
    options.guidance_scale = 2;
    options.frame_noise = FrameNoise::fresh;
    options.frame_history = 0;
    return *settle_renderer(golden_model(), options);
}

std::vector<uint32_t> seen(uint32_t frame)
{
    std::vector<uint32_t> words(kPixels);
    for (size_t i = 0; i < words.size(); ++i)
        words[i] = (uint32_t((i + frame * 77) * 2654435761u) >> 8) | (i * i % 7 < 4 ? 0xff000000u : 0);
    return words;
}

using Picture = std::vector<uint8_t>;

// encoder, denoiser and decoder by hand, every picture and latent as numbers of the host's
std::vector<Picture> by_hand(DType precision)
{
    const GoldenRenderer n(device(), "asd_rollout_tiny", 5, precision);
    const RendererSettings s = settings();
    const auto encoder = *FrameEncoder::create(device(), *n.vae, kSize, false);
    const auto decoder = *FrameDecoder::create(device(), *n.vae, kSize, 1);
    const auto denoiser = *AsdRenderer::create(device(), *n.unet, s.plan, {5, n.text}, kSize, s.asd);
    std::vector<Picture> frames;
    std::vector<float> previous;
    for (uint32_t f = 0; f < kFrames; ++f) {
        std::vector<float> color;
        Picture visible;
        for (const uint32_t word : seen(f)) {
            for (const int shift : {0, 8, 16})
                color.push_back(float(uint8_t(word >> shift)) / 127.5f - 1);
            visible.push_back(uint8_t(word >> 24));
        }
        const std::vector<float> buffer = *encoder->encode(color), shares = block_shares(kSize, visible);
        previous = *denoiser->render({f, 0, buffer, shares, previous});
        Picture& frame = frames.emplace_back();
        const std::vector<float> image = *decoder->decode(previous);
        for (const float v : image)
            frame.push_back(uint8_t(std::lround(std::clamp((v + 1) * 127.5f, 0.f, 255.f))));
    }
    return frames;
}

// an application's frames, by camera
struct Memory : FrameStore {
    std::map<std::string, std::vector<Picture>> frames;
    std::map<uint32_t, std::vector<float>> latents; // to go on from

    Status read_seen(const CameraChain&, uint32_t frame, const DeviceTensor& to) override
    {
        return to.write(device(), seen(frame));
    }
    Result<FrameView> view(const CameraChain&, uint32_t) override { return FrameView{}; }
    Status save_frame(const CameraChain& chain, uint32_t, const DeviceTensor& pixels) override
    {
        Picture& picture = frames[chain.name].emplace_back(*pixels.read<uint8_t>(device()));
        picture.resize(kPixels * 3);
        return {};
    }
    Status save_latent(const CameraChain&, uint32_t frame, const std::vector<float>& latent) override
    {
        latents[frame] = latent;
        return {};
    }
    Result<std::vector<float>> load_latent(const CameraChain&, uint32_t frame) override { return latents.at(frame); }
};

struct Rig {
    Memory memory;
    std::vector<CameraChain> cameras;
    std::unique_ptr<DeferredRenderer> renderer;

    explicit Rig(std::vector<std::string> names, const std::shared_ptr<LoadedNetworks>& networks, Device& on = device())
    {
        for (const std::string& name : names) {
            cameras.emplace_back().name = name;
            cameras.back().work.size = kSize;
        }
        std::vector<const CameraChain*> chains;
        std::vector<RendererWork> work;
        for (const CameraChain& c : cameras) {
            chains.push_back(&c);
            work.push_back(c.work);
        }
        const MemoryPlan plan = *plan_renderer(on, *networks, settings(), work, 0);
        renderer = *DeferredRenderer::create(on, networks, settings(), plan, chains, memory);
    }
    void make(uint32_t frame, size_t camera = 0)
    {
        const FrameWindow window{frame, 1, 0};
        for (const FramePart part : {FramePart::encode, FramePart::denoise, FramePart::decode})
            for (bool done = false; !done;) {
                const auto more = renderer->step({part, &cameras[camera], window, window});
                ASSERT_TRUE(more) << more.error().message;
                done = *more;
            }
    }
};

std::shared_ptr<LoadedNetworks> networks(DType precision = DType::f16)
{
    return std::make_shared<LoadedNetworks>(device(), golden_model(), precision);
}

TEST(engine_deferred_renderer, frames_have_the_bytes_of_encoder_denoiser_and_decoder_by_hand)
{
    for (DType precision : {DType::f32, DType::f16}) {
        Rig run({""}, networks(precision));
        for (uint32_t f = 0; f < kFrames; ++f)
            run.make(f);
        EXPECT_NE(run.memory.frames[""][0], run.memory.frames[""][1]);
        EXPECT_EQ(run.memory.frames[""], by_hand(precision)) << dtype_name(precision);
    }
}

TEST(engine_deferred_renderer, frames_that_were_given_up_leave_nothing_behind_and_another_run_goes_on_from_latents)
{
    const auto shared = networks();
    Rig whole({""}, shared), broken({""}, shared), later({""}, shared);
    for (uint32_t f = 0; f < kFrames; ++f)
        whole.make(f);
    broken.make(0);
    const FrameWindow wrong{1, 1, 0};
    ASSERT_TRUE(broken.renderer->step({FramePart::encode, &broken.cameras[0], wrong, wrong}));
    ASSERT_TRUE(broken.renderer->step({FramePart::denoise, &broken.cameras[0], wrong, wrong}));
    ASSERT_TRUE(broken.renderer->cancel());
    broken.renderer->forget(broken.cameras[0], 1);
    broken.make(1);
    broken.make(2);
    EXPECT_EQ(whole.memory.frames, broken.memory.frames);
    later.cameras[0].first = 2;
    later.cameras[0].before = 1;
    later.memory.latents = whole.memory.latents;
    later.make(2);
    EXPECT_EQ(later.memory.frames[""][0], whole.memory.frames[""][2]);
}

// however their frames alternate, in one renderer or in two, with one copy of the weights
TEST(engine_deferred_renderer, cameras_share_weights_and_do_not_know_of_each_other)
{
    const auto shared = networks();
    const uint64_t before = device().allocated_bytes();
    Rig rig({"left", "right"}, shared);
    const uint64_t one = device().allocated_bytes() - before;
    for (uint32_t f = 0; f < kFrames; ++f)
        for (const size_t camera : {0, 1})
            rig.make(f, camera);
    EXPECT_EQ(device().allocated_bytes() - before, one) << "programs come and go";
    Rig left({"left"}, shared), right({"right"}, shared);
    const auto vae = *shared->vae();
    const auto unet = *shared->unet();
    const uint64_t weights = vae->device_bytes(device().limits()) + unet->device_bytes(device().limits());
    EXPECT_EQ(device().allocated_bytes() - before, 3 * one - 2 * weights);
    for (uint32_t f = 0; f < kFrames; ++f) {
        right.make(f);
        left.make(f);
    }
    EXPECT_EQ(rig.memory.frames["left"], left.memory.frames["left"]);
    EXPECT_EQ(rig.memory.frames["right"], right.memory.frames["right"]);
    EXPECT_NE(rig.memory.frames["left"], rig.memory.frames["right"]);
}

TEST(engine_deferred_renderer, what_is_not_finite_is_reported_with_its_frame)
{
    Rig run({"front"}, networks());
    run.cameras[0].first = 4;
    run.cameras[0].before = 1;
    run.memory.latents[3].assign(kSize.pixels() * 4, 0.5f);
    run.memory.latents[3][9] = std::numeric_limits<float>::quiet_NaN();
    const FrameWindow window{4, 1, 0};
    ASSERT_TRUE(run.renderer->step({FramePart::encode, &run.cameras[0], window, window}));
    Result<bool> done = false;
    while (done && !*done)
        done = run.renderer->step({FramePart::denoise, &run.cameras[0], window, window});
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, ErrorCode::internal);
    EXPECT_TRUE(done.error().message.starts_with("frame 4 of camera 'front': the denoised latent holds "))
        << done.error().message;
    EXPECT_TRUE(done.error().message.ends_with(": overflow; try `precision` fp32")) << done.error().message;
}

} // namespace engine_deferred_renderer_test
} // namespace semrover
