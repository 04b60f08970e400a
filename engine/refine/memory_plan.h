// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/vsd.h"

namespace semrover {

// Which networks are on the device at the same time.
enum class MemoryPolicy {
    resident, // both for the whole run, and the memory of one kind of work at a time; frames (or windows of them) are
              // ready one by one
    staged,   // the VAE encodes every buffer, then the UNet denoises every frame, then the VAE decodes every latent; of
              // a window the guided half and the other one after the other
};
std::string_view policy_name(MemoryPolicy policy);

// The work of a run on pictures of one size.
struct RendererWork {
    LatentSize size;
    bool encode = true, denoise = true, decode = true;
    uint32_t frames = 1, decode_frames = 1; // denoised, and decoded, together

    bool same_shapes(const RendererWork& other) const
    {
        return size == other.size && frames == other.frames && decode_frames == other.decode_frames;
    }
};

// device bytes of a renderer's parts; 0 where a run has no work for them
struct RendererBytes {
    uint64_t unet = 0, vae = 0; // weights
    uint64_t outgoing = 0;      // of what is on its way to files
    struct Size {
        uint64_t state = 0, denoise = 0, encode = 0, decode = 0;
        uint64_t apart = 0; // state and denoise with the halves one after the other
    };
    std::vector<Size> sizes; // one per RendererWork

    uint64_t peak(MemoryPolicy policy) const;
};

// Plans the bytes of each part, without allocating. Unet::plan and Vae::plan are enough for the networks.
struct RendererNetworks {
    const Unet& unet;
    const Vae& vae;
    const SamplingPlan& plan;
    uint32_t text_tokens = 0;
    float guidance_scale = 1;
    VsdOptions video = {}; // of a UNet of videos
};
Result<RendererBytes> renderer_bytes(const DeviceLimits& limits, const RendererNetworks& networks,
                                     std::span<const RendererWork> work);

struct MemoryPlan {
    MemoryPolicy policy = MemoryPolicy::resident;
    uint64_t bytes = 0; // of the whole run, with what is allocated before it
    RendererBytes parts;
};

// Returns the first policy that fits `budget` (0: no budget) beside the bytes that are `allocated` already.
// Errors: out_of_memory, with the bytes of each policy
Result<MemoryPlan> plan_memory(RendererBytes parts, uint64_t allocated, uint64_t budget);

} // namespace semrover
