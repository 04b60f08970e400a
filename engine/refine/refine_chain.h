// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/buffer_folder.h"
#include "engine/refine/frame_windows.h"
#include "engine/refine/latent_size.h"

namespace semrover {

// How a drive is cut: windows of `frames`, which begin `overlap` frames before the first one that is new. Frames are
// decoded `decode_frames` at a time.
struct WindowShape {
    uint32_t frames = 1, overlap = 0, decode_frames = 1; // frame by frame
};

// the frames of one camera: a chain that depends on no other, each frame or window on the one before
struct RefineChain {
    BufferCamera camera;
    FrameRange range;
    LatentSize size;
    std::vector<float> before;        // latents of frames before the range; empty: the first frame has none before it
    std::vector<CameraFrame> cameras; // of all frames, where surfaces are followed from one to the next
    bool warped_noise = false;        // noise stays on surfaces; else each frame has its own
    float history = 0;                // share of the frame before in a finished one (FrameHistory)
    std::vector<uint8_t> picture_before = {}; // finished, before the range; empty: none
    WindowShape shape = {};
    std::vector<FrameWindow> windows = {}; // of the range, as they are denoised
};

// The windows that the frames which `window` makes are decoded in: the first frames of each are decoded for those after
// them, and not kept.
std::vector<FrameWindow> decode_windows(const RefineChain& chain, const FrameWindow& window);

// noise key of a camera, from its name: the same whichever cameras are refined beside it
uint32_t chain_key(const std::string& camera);

} // namespace semrover
