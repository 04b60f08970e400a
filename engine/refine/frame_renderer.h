// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/loaded_networks.h"
#include "engine/refine/memory_plan.h"
#include "runtime/device/copy_ring.h"

namespace semrover {

// The networks of a renderer at work under a memory policy: buffers to latents, latents to frames. What the policy does
// not keep is dropped when other work begins, and made again when it is wanted; the results do not depend on it.
class FrameRenderer {
  public:
    // loads nothing yet; the plan must outlive it
    FrameRenderer(Device& device, std::shared_ptr<LoadedNetworks> networks, const SamplingPlan& plan,
                  AsdOptions options, MemoryPolicy policy);
    ~FrameRenderer();

    // what the next calls are about; with the resident policy both networks are loaded here, as far as `run` (the whole
    // run's work) needs them. Errors: bad_input for weights that do not fit the model; device errors
    Status start(const RendererWork& work, const RendererWork& run);
    // With the resident policy: makes the programs of all three kinds of work once, so that no later call compiles.
    // Between frames only
    Status compile();

    // as LatentCodec does it; not between begin and finish of a frame
    Result<std::vector<float>> encode(std::span<const float> image);
    Result<std::vector<float>> decode(std::span<const float> latent);
    // as AsdRenderer does it
    Status begin(const AsdFrame& frame);
    Result<bool> step(size_t submits); // true when the latent is done
    Result<std::vector<float>> finish();
    Status cancel();

    // The same with latents that stay on the device from the splats' pixels to the frame's bytes: under the resident
    // policy, and for work that denoises. Nothing is read back but a word of each: are all numbers finite?
    // Errors: internal where they are not; device errors
    Status encode_seen(const Slot& seen);                                             // as splat_pixels() makes it
    Status encode_seen(std::span<const uint32_t> seen);                               // the same from the host
    Status use_latent(std::span<const float> buffer, std::span<const float> visible); // or what was encoded before
    Status use_previous(std::span<const float> latent); // of the frame before, where this run did not make it
    Status begin_frame(const AsdStart& frame);     // then step; after the frame before: its latent is the previous one
    Status end_frame();                            // slots().latent of denoiser() is the frame's
    Result<Slot> decode_latent();                  // of the frame that has ended -> its bytes
    AsdRenderer* denoiser() { return asd_.get(); } // while there is one

  private:
    enum class Part { encode, denoise, decode };
    Status make_way(Part part); // drops what the policy does not keep beside it
    Status make_asd();
    Result<LatentCodec*> codec(CodecDirection direction);
    Status make_denoiser();
    Status copy(const Slot& from, const Slot& to);
    Status encoded(const LatentCodec& codec);

    Device& device_;
    const SamplingPlan& plan_;
    AsdOptions options_;
    MemoryPolicy policy_;
    LatentSize size_;
    NetworksInUse networks_;
    std::unique_ptr<AsdRenderer> asd_;
    std::unique_ptr<LatentCodec> codec_;
    CodecDirection direction_ = CodecDirection::encode; // of codec_
    std::unique_ptr<CopyRing> copies_;
};

} // namespace semrover
