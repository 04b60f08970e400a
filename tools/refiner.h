// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/refine/frame_renderer.h"
#include "tools/cli/commands.h"
#include "tools/refine_store.h"

namespace semrover {

// frames of a camera that a run refines, first and last included
struct FrameRange {
    uint32_t first = 0, last = 0;

    uint32_t count() const { return last - first + 1; }
};

// the frames of one camera: an autoregressive chain that depends on no other
struct RefineChain {
    BufferCamera camera;
    FrameRange range;
    LatentSize size;
    std::vector<float> before;        // latent of frame range.first - 1; empty: the first frame has none before it
    std::vector<CameraFrame> cameras; // of all frames, for noise that stays on surfaces; empty: each frame has its own
};

// noise key of a camera, from its name: the same whichever cameras are refined beside it
uint32_t chain_key(const std::string& camera);

// Brings every frame of every chain to the end: what the store has is taken from there. The order of the work is the
// memory policy's; the frames do not depend on it.
class Refiner {
  public:
    Refiner(const RefineStore& store, std::span<const RefineChain> chains);

    // what is left to do, one per chain
    std::span<const RendererWork> work() const { return work_; }
    RendererWork total() const; // size apart

    // errors: interrupted; internal for NaN, with frame and stage
    Status run(FrameRenderer& renderer, RefineStore& store, MemoryPolicy policy, size_t steps, const Device& device,
               const Globals& globals);

  private:
    struct Session; // one run()

    std::span<const RefineChain> chains_;
    std::vector<RendererWork> work_;
    size_t latents_ = 0;
};

} // namespace semrover
