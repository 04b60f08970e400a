// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/buffer_folder.h"
#include "engine/refine/latent_size.h"

#include <vector>

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

} // namespace semrover
