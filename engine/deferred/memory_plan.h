// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/asd.h"
#include "engine/deferred/vsd.h"
#include "engine/network/vae.h"

namespace semrover {

// Which parts of a renderer are on the device at the same time.
enum class MemoryPolicy {
    resident, // both networks and the programs of all kinds of work, which share an arena; frames (or windows of them)
              // are ready one by one
    staged,   // one network at a time: the VAE encodes every buffer, then the UNet denoises every frame, then the VAE
              // decodes every latent; of a window the guided half and the other one after the other
};
std::string_view policy_name(MemoryPolicy policy);

// The work on pictures of one size.
struct RendererWork {
    LatentSize size;
    bool encode = true, denoise = true, decode = true;
    uint32_t frames = 1, decode_frames = 1; // denoised, and decoded, together

    bool any() const { return encode || denoise || decode; }
    bool same_shapes(const RendererWork& other) const
    {
        return size == other.size && frames == other.frames && decode_frames == other.decode_frames;
    }
};

// device bytes of a renderer's parts; 0 where a run has no work for them
struct RendererBytes {
    uint64_t unet = 0, vae = 0; // weights that are not on the device yet
    uint64_t beside = 0;        // of what stays beside the renderer, such as what is on its way to files
    struct Size {
        RendererWork work;
        PartBytes encode, denoise, decode;
        PartBytes apart; // denoise with the halves one after the other

        ArenaSize arena() const; // of the resident policy
    };
    std::vector<Size> sizes; // one per shapes of RendererWork

    uint64_t peak(MemoryPolicy policy) const;
    const Size& of(const RendererWork& work) const; // of its shapes
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
