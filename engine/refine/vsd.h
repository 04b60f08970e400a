// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/asd.h"

namespace semrover {

struct VsdOptions {
    float first_guidance = 1, last_guidance = 3; // guidance is linear over the frames; 1 and 1: no unconditional half
    uint64_t seed = 0;
    // golden cases only: normals come from the caller, [frames, pixels, C]
    std::function<void(uint32_t window, std::span<float> noise)> noise;
};

// a window of frames; pixels are those of the latent
struct VsdWindow {
    uint32_t number = 0;            // of its first frame, part of the noise key
    uint32_t chain = 0;             // of the camera, likewise
    std::span<const float> buffers; // [frames, pixels, C] latents of the splat buffers, not scaled
    std::span<const float> visible; // [frames, pixels] 0..1
};

// numbers that come with a video, such as frames a second, motion and noise of the image; SVD's UNet takes these three
struct VideoConditioning {
    Conditioning text;
    std::span<const float> added;
};

// The video renderer: the frames of a window are denoised together by a UNet of videos. It sees the noisy latents, the
// splat buffers' latents and their visibility; the unconditional half sees no visibility. The graph is built once for a
// picture size and a number of frames, and replayed for every step; embeddings and keys and values of the text are
// computed once.
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

    size_t steps() const { return plan_.rows.size(); }
    uint64_t arena_bytes() const; // of the programs

  private:
    struct Memory;
    VsdRenderer(Device& device, const SamplingPlan& plan, VsdOptions options);
    Status make_tables(const VideoConditioning& conditioning);
    Status make_programs();
    Status upload(const VsdWindow& window);
    Result<std::vector<float>> read() const;

    Device& device_;
    SamplingPlan plan_;
    VsdOptions options_;
    std::unique_ptr<Memory> memory_;
    std::unique_ptr<Program> begin_, step_;
    std::optional<Replay> replay_;

  public:
    ~VsdRenderer();
};

} // namespace semrover
