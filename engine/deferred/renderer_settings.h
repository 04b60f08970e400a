// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/asd.h"
#include "engine/deferred/vsd.h"
#include "engine/model/renderer_model.h"

#include <cstdint>
#include <vector>

namespace semrover {

// frames of a camera that a run refines, first and last included
struct FrameRange {
    uint32_t first = 0, last = 0;

    uint32_t count() const { return last - first + 1; }
};

// Frames that are worked on together. The first `known` of them are done already.
struct FrameWindow {
    uint32_t first = 0, count = 1, known = 0;

    uint32_t next() const { return first + known; } // the first frame that the window makes
    uint32_t end() const { return first + count; }
    uint32_t made() const { return count - known; }
    bool operator==(const FrameWindow&) const = default;
};

// How a trajectory is cut: windows of `frames`, which begin `overlap` frames before the first one that is new. Frames
// are decoded `decode_frames` at a time.
struct WindowShape {
    uint32_t frames = 1, overlap = 0, decode_frames = 1; // frame by frame
};

// Cuts a range into windows of `length` frames. Each begins `overlap` (below `length`) frames before the first one that
// it makes; `before` frames in front of the range are done already. The last window is moved back until it is full. So
// all have the same length: `length`, or less where there are not so many frames.
std::vector<FrameWindow> frame_windows(const FrameRange& range, uint32_t before, uint32_t length, uint32_t overlap);

// The windows that the frames which `window` makes are decoded in, `length` at a time: the first frames of each are
// decoded for those after them, and not kept.
std::vector<FrameWindow> decode_windows(const FrameWindow& window, uint32_t length);

// what the application asks of a renderer; what it leaves out is as the model says
struct RendererOptions {
    std::optional<int> steps; // of denoising a frame, or a window of frames
    std::optional<float> guidance_scale, previous_noise, frame_history;
    std::optional<FrameNoise> frame_noise;
    // of a renderer of videos: guidance of a window's first frame (guidance_scale is that of the last), frames of a
    // window, frames that it knows of the one before, frames that are decoded together
    std::optional<float> first_guidance_scale;
    std::optional<uint32_t> window_frames, window_overlap, decode_frames;
    uint64_t seed = 0;
};

// how frames are made
struct RendererSettings {
    SamplingPlan plan;
    int steps = 0;
    AsdOptions asd;
    VsdOptions vsd; // of a renderer of videos, in place of `asd`
    WindowShape shape;
    FrameNoise frame_noise = FrameNoise::fresh;
    float frame_history = 0; // share of the frame before in a finished one (FrameHistory)

    // depth and cameras say which surfaces a frame shares with the one before
    bool follows_surfaces() const { return frame_noise == FrameNoise::warped || frame_history > 0; }
};

// Errors: usage for what this kind of model does not have, and for numbers out of range
Result<RendererSettings> settle_renderer(const RendererModel& model, const RendererOptions& options);

} // namespace semrover
