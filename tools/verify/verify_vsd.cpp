// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kind vsd_window: the frames of a window through encoder, denoiser and decoder
#include "engine/deferred/frame_codec.h"
#include "engine/deferred/vsd.h"
#include "tools/verify/golden_case.h"
#include "tools/verify/golden_networks.h"

#include <algorithm>

namespace semrover {

namespace {

// inputs of a case that belong together
struct WindowInputs {
    uint32_t frames = 0, tokens = 0;
    LatentSize size;
    Planar image, latent;
    std::vector<float> buffers, visible, text, added, noise;
};

Result<WindowInputs> window_inputs(const GoldenCase& c, const GoldenNetworks& n)
{
    const auto shape = c.shape("input.buffers"), text_shape = c.shape("input.encoder_hidden_states"); // [F, 3, H, W]
    if (shape.size() != 4 || text_shape.size() != 3 || text_shape[0] != 1 || text_shape[1] > 4096 || shape[0] == 0 ||
        shape[0] > kMostFrames || text_shape[2] != n.unet->config().cross_attention_dim)
        return fail(ErrorCode::bad_input,
                    "{}: expected buffers [frames, 3, height, width] and a text of [1, tokens, {}]", c.name(),
                    n.unet->config().cross_attention_dim);
    WindowInputs in;
    in.frames = uint32_t(shape[0]);
    in.tokens = uint32_t(text_shape[1]);
    in.size = {uint32_t(shape[3]), uint32_t(shape[2]), n.vae->config().downscale()};
    in.image = {shape[1], shape[2] * shape[3]};
    in.latent = {n.vae->config().latent_channels, in.size.pixels()};
    in.buffers = c.floats("input.buffers");
    in.visible = c.floats("input.visible");
    in.text = c.floats("input.encoder_hidden_states");
    in.added = c.floats("input.added_time_ids");
    in.noise = c.floats("input.noise_initial");
    if (in.visible.size() * shape[1] != in.buffers.size() ||
        in.noise.size() != in.frames * in.latent.channels * in.latent.pixels)
        return fail(ErrorCode::bad_input, "{}: inputs do not belong together", c.name());
    return in;
}

// latents of the buffers and their visible shares, frame by frame
Status encode_window(Device& device, const Vae& vae, const WindowInputs& in, std::vector<float>& buffers,
                     std::vector<float>& shares)
{
    SR_TRY(const auto encoder, FrameEncoder::create(device, vae, in.size, true));
    for (uint32_t f = 0; f < in.frames; ++f) {
        SR_TRY(const std::vector<float> latent, encoder->encode(in.image.interleaved(in.buffers, f)));
        buffers.insert(buffers.end(), latent.begin(), latent.end());
        std::vector<uint8_t> mask(in.image.pixels);
        for (size_t i = 0; i < mask.size(); ++i)
            mask[i] = in.visible[f * mask.size() + i] > 0.5f;
        const std::vector<float> frame = block_shares(in.size, mask);
        shares.insert(shares.end(), frame.begin(), frame.end());
    }
    return {};
}

} // namespace

Result<GoldenOutputs> run_vsd_window(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const GoldenNetworks n, load_networks(device, c.model(), precision));
    std::vector<std::string> warnings;
    SR_TRY(const SchedulerConfig scheduler,
           scheduler_config_from_json(c.params().value("scheduler", nlohmann::json()), warnings));
    SR_TRY(const double steps, c.number("num_inference_steps"));
    SR_TRY(const double first, c.number("guidance_min"));
    SR_TRY(const double last, c.number("guidance_max"));
    SR_TRY(const SamplingPlan plan, plan_sampling(scheduler, int(steps)));
    SR_TRY(const WindowInputs in, window_inputs(c, n));
    const size_t pixels = in.latent.pixels * in.latent.channels, image_size = in.image.pixels * in.image.channels;
    VsdOptions options;
    options.first_guidance = float(first);
    options.last_guidance = float(last);
    options.noise = [&](uint32_t, std::span<float> noise) {
        for (uint32_t f = 0; f < in.frames; ++f)
            std::ranges::copy(in.latent.interleaved(in.noise, f), noise.begin() + std::ptrdiff_t(f * pixels));
    };
    std::vector<float> buffers, shares;
    SR_CHECK(encode_window(device, *n.vae, in, buffers, shares));
    SR_TRY(const auto vsd,
           VsdRenderer::create(device, *n.unet, plan, {in.tokens, in.text, in.added}, in.size, in.frames, options));
    SR_TRY(const std::vector<float> latents, vsd->render({0, 0, buffers, shares}));
    SR_TRY(const auto decoder, FrameDecoder::create(device, *n.vae, in.size, in.frames));
    SR_TRY(const std::vector<float> images, decoder->decode(latents));
    GoldenOutputs out;
    for (uint32_t f = 0; f < in.frames; ++f) {
        in.latent.append({&latents[f * pixels], &latents[f * pixels] + pixels}, out.floats["latents"]);
        in.image.append({&images[f * image_size], &images[f * image_size] + image_size}, out.floats["images"]);
    }
    return out;
}

} // namespace semrover
