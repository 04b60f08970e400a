// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/denoiser.h"

namespace semrover {

struct AsdOptions {
    float guidance_scale = 1.5f; // 1: no unconditional half
    float previous_noise = 0.3f; // standard deviation of the noise on the previous frame's latent
    uint64_t seed = 0;
    // golden cases only: normals come from the caller, [pixels, C] for the first state and for the previous latent
    std::function<void(uint32_t frame, std::span<float> initial, std::span<float> previous)> noise;
};

// Autoregressive renderer, one frame at a time: the UNet sees the noisy latent, the previous frame's latent with noise
// on it, the splat buffer's latent and its visibility (docs/method.md §6.1).
class AsdRenderer : public Denoiser {
  public:
    // arena: null: its own. Errors: usage for a guidance scale or noise out of range; bad_input for a UNet of other
    // channels; device errors
    static Result<std::unique_ptr<AsdRenderer>> create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                       const Conditioning& conditioning, const LatentSize& size,
                                                       AsdOptions options, SharedArena arena = {});
    static Result<PartBytes> planned_bytes(const DeviceLimits& limits, const Unet& unet, const SamplingPlan& plan,
                                           uint32_t text_tokens, const LatentSize& size, float guidance_scale);

  private:
    struct FrameMemory;
    AsdRenderer(Device& device, const SamplingPlan& plan, AsdOptions options);
    Status upload(const DenoiserWindow& window) const override;
    Status after_begin(const DenoiserWindow& window) const override;

    AsdOptions options_;
    const FrameMemory* frame_ = nullptr;
};

} // namespace semrover
