// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/denoiser.h"

namespace semrover {

struct VsdOptions {
    float first_guidance = 1, last_guidance = 3; // guidance is linear over the frames; 1 and 1: no unconditional half
    float correlation = 0; // of neighbouring frames, 0..1: of what known frames are off by; 0: not carried to others
    uint64_t seed = 0;
    bool halves_apart = false; // guided and not, one after the other: half of the memory, the same latents
    // golden cases only: normals come from the caller, [frames, pixels, C]
    std::function<void(uint32_t window, std::span<float> noise)> noise;
};

// The video renderer: the frames of a window are denoised together by a UNet of videos. It sees the noisy latents, the
// splat buffers' latents, not scaled, and their visibility; the unconditional half sees no visibility. Frames that are
// known are held: at every level of noise they are what they are plus the noise that they began with, and they leave as
// they came. What the network says wrongly of them corrects what it says of the others (docs/method.md §6.4).
class VsdRenderer : public Denoiser {
  public:
    // arena: null: its own. Errors: usage for a guidance scale out of range or too many frames; bad_input for a UNet of
    // other channels, or of single images; device errors
    static Result<std::unique_ptr<VsdRenderer>> create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                       const Conditioning& conditioning, const LatentSize& size,
                                                       uint32_t frames, VsdOptions options, SharedArena arena = {});
    static Result<PartBytes> planned_bytes(const DeviceLimits& limits, const Unet& unet, const SamplingPlan& plan,
                                           uint32_t text_tokens, const LatentSize& size, uint32_t frames,
                                           const VsdOptions& options);

  private:
    struct WindowMemory;
    VsdRenderer(Device& device, const SamplingPlan& plan, VsdOptions options);
    Status write_tables() const override;
    Status upload(const DenoiserWindow& window) const override;

    VsdOptions options_;
    const WindowMemory* window_ = nullptr;
};

// How far known frames are off in a step's prediction says how far the others are off, too (docs/method.md §6.4). The
// weights of that for step_carry(), [rows of the plan, frames, frames]: of a row and frame, for each of the first
// `known` frames. They are those of frames that are Gaussian and whose correlation falls by `correlation` (0..1) from
// one to the next: cov(frame, known) cov(known, known)^-1, given the noisy frames.
std::vector<float> known_frame_weights(const SamplingPlan& plan, uint32_t frames, uint32_t known, double correlation);

} // namespace semrover
