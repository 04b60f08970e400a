// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/model/renderer_model.h"
#include "engine/refine/memory_plan.h"

namespace semrover {

// The networks of a renderer at work under a memory policy: buffers to latents, latents to frames. What the policy does
// not keep is dropped when other work begins, and made again when it is wanted; the results do not depend on it.
class FrameRenderer {
  public:
    // loads nothing yet; the model must outlive it
    FrameRenderer(Device& device, const RendererModel& model, const SamplingPlan& plan, DType precision,
                  AsdOptions options, MemoryPolicy policy);
    ~FrameRenderer();

    // what the next calls are about; with the resident policy both networks are loaded here, as far as `run` (the whole
    // run's work) needs them. Errors: bad_input for weights that do not fit the model; device errors
    Status start(const RendererWork& work, const RendererWork& run);

    // as LatentCodec and AsdRenderer do it
    Result<std::vector<float>> encode(std::span<const float> image);
    Result<std::vector<float>> denoise(const AsdFrame& frame, const AsdRenderer::StepCallback& callback);
    Result<std::vector<float>> decode(std::span<const float> latent);

  private:
    enum class Part { encode, denoise, decode };
    Status make_way(Part part); // drops what the policy does not keep beside it
    Status load_unet();
    Status load_vae();
    Status make_asd();
    Result<LatentCodec*> codec(CodecDirection direction);

    Device& device_;
    const RendererModel& model_;
    const SamplingPlan& plan_;
    DType precision_;
    AsdOptions options_;
    MemoryPolicy policy_;
    LatentSize size_;
    std::unique_ptr<Unet> unet_;
    std::unique_ptr<Vae> vae_;
    std::unique_ptr<AsdRenderer> asd_;
    std::unique_ptr<LatentCodec> codec_;
    CodecDirection direction_ = CodecDirection::encode; // of codec_
};

} // namespace semrover
