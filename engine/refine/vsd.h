// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/asd.h"

namespace semrover {

struct VsdOptions {
    float first_guidance = 1, last_guidance = 3; // guidance is linear over the frames; 1 and 1: no unconditional half
    float correlation = 0; // of neighbouring frames, 0..1: of what known frames are off by; 0: not carried to others
    uint64_t seed = 0;
    bool halves_apart = false; // guided and not, one after the other: half of the memory, the same latents
    // golden cases only: normals come from the caller, [frames, pixels, C]
    std::function<void(uint32_t window, std::span<float> noise)> noise;
};

// a window of frames; pixels are those of the latent
struct VsdWindow {
    uint32_t number = 0;              // of its first frame, part of the noise key
    uint32_t chain = 0;               // of the camera, likewise
    std::span<const float> buffers;   // [frames, pixels, C] latents of the splat buffers, not scaled
    std::span<const float> visible;   // [frames, pixels] 0..1
    std::span<const float> known{};   // [up to frames, pixels, C] latents of the first frames, where those are done
    std::span<const NoiseKey> keys{}; // [frames, pixels]; empty: each pixel's own, of its frame
};

// The video renderer: the frames of a window are denoised together by a UNet of videos. It sees the noisy latents, the
// splat buffers' latents and their visibility; the unconditional half sees no visibility. Frames that are known are
// held: at every level of noise they are what they are plus the noise that they began with, and they leave as they
// came. What the network says wrongly of them corrects what it says of the others (docs/method.md §6.4). The graph is
// built once for a picture size and a number of frames, and replayed for every step; embeddings and keys and values of
// the text are computed once.
class VsdRenderer {
  public:
    // errors: usage for a guidance scale out of range or too many frames; bad_input for a UNet of other channels, or
    // of single images; device errors
    static Result<std::unique_ptr<VsdRenderer>> create(Device& device, const Unet& unet, const SamplingPlan& plan,
                                                       const VideoConditioning& conditioning, const LatentSize& size,
                                                       uint32_t frames, VsdOptions options);

    // device memory beside the UNet's weights
    static Result<AsdRenderer::Bytes> planned_bytes(const DeviceLimits& limits, const Unet& unet,
                                                    const SamplingPlan& plan, uint32_t text_tokens,
                                                    const LatentSize& size, uint32_t frames, const VsdOptions& options);

    // called after every step; returning false stops (ErrorCode::interrupted)
    using StepCallback = AsdRenderer::StepCallback;
    // -> [frames, pixels, C] latents. Errors: internal when the network returns NaN or infinity; interrupted; device
    // errors
    Result<std::vector<float>> render(const VsdWindow& window, const StepCallback& callback = {});

    // the same, piecewise, as of AsdRenderer. What the window's spans show is copied by begin.
    Status begin(const VsdWindow& window);
    Result<bool> step(size_t submits);
    Result<std::vector<float>> finish();
    Status cancel();
    // [frames, pixels, C] of a window that is not finished, or was cancelled
    Result<std::vector<float>> state() const;

    // drops the programs and their memory until the next window; between windows only
    void rest();

    uint32_t frames() const;
    size_t steps() const { return plan_.rows.size(); }
    uint64_t arena_bytes() const;                               // of the programs
    const Program* step_program() const { return step_.get(); } // while there is one

  private:
    struct Memory;
    VsdRenderer(Device& device, const SamplingPlan& plan, VsdOptions options);
    Status make_tables(const VideoConditioning& conditioning);
    Status make_programs();
    Status upload(const VsdWindow& window);
    Status upload_keys(const VsdWindow& window);
    Status check();

    Device& device_;
    SamplingPlan plan_;
    VsdOptions options_;
    std::unique_ptr<Memory> memory_;
    std::unique_ptr<Program> begin_, step_, check_;
    std::optional<Replay> replay_;

  public:
    ~VsdRenderer();
};

} // namespace semrover
