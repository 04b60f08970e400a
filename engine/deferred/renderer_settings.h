// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/asd.h"
#include "engine/deferred/frame_windows.h"
#include "engine/deferred/vsd.h"
#include "engine/model/renderer_model.h"

namespace semrover {

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
