// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/loaded_networks.h"
#include "engine/refine/memory_plan.h"
#include "engine/refine/video_decoder.h"

namespace semrover {

// a splat buffer as the video renderer sees it; pixels are those of the latent
struct EncodedBuffer {
    std::vector<float> latent;  // [pixels, C], not scaled
    std::vector<float> visible; // [pixels] 0..1
};

// The networks of a video renderer at work under a memory policy: buffers to latents, windows of latents to latents,
// some frames' latents to frames. What the policy does not keep is dropped when other work begins, and made again when
// it is wanted; the results do not depend on it.
class WindowRenderer {
  public:
    // loads nothing yet; the plan must outlive it
    WindowRenderer(Device& device, std::shared_ptr<LoadedNetworks> networks, const SamplingPlan& plan,
                   VsdOptions options, MemoryPolicy policy);
    ~WindowRenderer();

    // what the next calls are about: size and numbers of frames. With the resident policy both networks are loaded
    // here, as far as `run` (the whole run's work) needs them. Errors: as FrameRenderer::start
    Status start(const RendererWork& work, const RendererWork& run);

    // seen: a buffer's picture, as splat_pixels() makes it; not between begin and finish of a window
    Result<EncodedBuffer> encode(std::span<const uint32_t> seen);
    // as VsdRenderer does it
    Status begin(const VsdWindow& window);
    Result<bool> step(size_t submits); // true when the latents are done
    Result<std::vector<float>> finish();
    Status cancel();
    // latents of work.decode_frames frames -> their bytes on the device, until the next call
    Result<const VideoDecoder*> decode(std::span<const float> latents);

  private:
    enum class Part { encode, denoise, decode };
    Status make_way(Part part); // drops what the policy does not keep beside it
    Status make_vsd();

    Device& device_;
    const SamplingPlan& plan_;
    VsdOptions options_;
    MemoryPolicy policy_;
    RendererWork work_;
    NetworksInUse networks_;
    std::unique_ptr<VsdRenderer> vsd_;
    std::unique_ptr<LatentCodec> encoder_;
    std::unique_ptr<VideoDecoder> decoder_;
};

} // namespace semrover
