// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// golden kind asd_rollout: a chain of frames through encoder, denoiser and decoder
#include "engine/deferred/asd.h"
#include "engine/deferred/frame_codec.h"
#include "tools/verify/golden_case.h"
#include "tools/verify/golden_networks.h"

#include <algorithm>

namespace semrover {

Result<GoldenOutputs> run_asd_rollout(Device& device, const GoldenCase& c, DType precision)
{
    SR_TRY(const GoldenNetworks n, load_networks(device, c.model(), precision));
    std::vector<std::string> warnings;
    SR_TRY(const SchedulerConfig scheduler,
           scheduler_config_from_json(c.params().value("scheduler", nlohmann::json()), warnings));
    SR_TRY(const double steps, c.number("num_inference_steps"));
    SR_TRY(const double guidance, c.number("guidance_scale"));
    SR_TRY(const double noise_scale, c.number("previous_noise_scale"));
    SR_TRY(const SamplingPlan plan, plan_sampling(scheduler, int(steps)));

    const auto buffers = c.floats("input.buffers"), visible = c.floats("input.visible"),
               text = c.floats("input.encoder_hidden_states"), initial = c.floats("input.noise_initial"),
               previous_noise = c.floats("input.noise_previous");
    const auto shape = c.shape("input.buffers"), text_shape = c.shape("input.encoder_hidden_states"); // [F, 3, H, W]
    if (shape.size() != 4 || text_shape.size() != 3 || visible.size() * shape[1] != buffers.size())
        return fail(ErrorCode::bad_input, "{}: inputs do not belong together", c.name());
    const LatentSize size{uint32_t(shape[3]), uint32_t(shape[2]), n.vae->config().downscale()};
    const Planar image{shape[1], shape[2] * shape[3]}, latent{n.vae->config().latent_channels, size.pixels()};
    if (initial.size() != shape[0] * latent.channels * latent.pixels || previous_noise.size() != initial.size())
        return fail(ErrorCode::bad_input, "{}: noise of another size than the latents", c.name());

    AsdOptions options;
    options.guidance_scale = float(guidance);
    options.previous_noise = float(noise_scale);
    options.noise = [&](uint32_t frame, std::span<float> first, std::span<float> more) {
        std::ranges::copy(latent.interleaved(initial, frame), first.begin());
        std::ranges::copy(latent.interleaved(previous_noise, frame), more.begin());
    };
    SR_TRY(const auto asd, AsdRenderer::create(device, *n.unet, plan, {uint32_t(text_shape[1]), text}, size, options));
    SR_TRY(const auto encoder, FrameEncoder::create(device, *n.vae, size, false));
    SR_TRY(const auto decoder, FrameDecoder::create(device, *n.vae, size, 1));
    GoldenOutputs out;
    std::vector<float> previous;
    for (uint32_t f = 0; f < shape[0]; ++f) {
        SR_TRY(const std::vector<float> buffer, encoder->encode(image.interleaved(buffers, f)));
        std::vector<uint8_t> mask(image.pixels);
        for (size_t i = 0; i < mask.size(); ++i)
            mask[i] = visible[f * mask.size() + i] > 0.5f;
        const std::vector<float> shares = block_shares(size, mask);
        SR_TRY(previous, asd->render({f, 0, buffer, shares, previous}));
        SR_TRY(const std::vector<float> frame, decoder->decode(previous));
        latent.append(previous, out.floats["latents"]);
        image.append(frame, out.floats["images"]);
    }
    return out;
}

} // namespace semrover
