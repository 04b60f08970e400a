// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/deferred/frame_images.h"
#include "engine/job/drawn_scene.h"
#include "engine/job/flow_drawing.h"
#include "engine/job/frame_rasterizers.h"

#include <functional>
#include <map>
#include <optional>
#include <tuple>

namespace semrover {

// what is known of a frame on the device
struct FrameSlots : SplatPixelSlots {
    FlowSlots flow = {}; // not valid where there is none
};

// Draws a camera path in order, a moment a step: what the cameras of a rig see at one time is drawn in one submit, with
// one rasterizer for each image size and camera model. Pictures stay on the device, as files have them.
class PathDrawing {
  public:
    // the pixels are there until it returns; a read of a ring that it starts is in time
    using Drawn = std::function<Status(const CameraFrame&, const FrameSlots&)>;

    // The scene must outlive it. flow: of every frame but a camera's last one
    PathDrawing(Device& device, const DrawnScene& scene, CameraPath path, const RasterizerOptions& options, bool flow);

    // `drawn` gets every frame of the next moment; true when that was the last one. At least one frame must be left.
    Result<bool> step(const Drawn& drawn);
    std::span<const CameraFrame> next() const; // of the next moment
    bool skip();                               // it; true when that was the last one
    size_t done() const { return done_; }      // frames so far
    size_t total() const { return path_.frames.size(); }

    // frames of one size and camera model, in all of which something moves while they are read out, or in none; apart
    // from the path
    Status draw(std::span<const CameraFrame> frames, const Drawn& drawn);
    // one frame's images on the host, where the options keep no pixels; waits for them
    Result<SplatImage> image(const CameraFrame& frame);

  private:
    size_t end_of_moment(size_t first) const;
    Result<FlowSlots> flow_of(size_t frame);

    const DrawnScene& scene_;
    CameraPath path_;
    FrameRasterizers rasterizers_;
    std::optional<FlowDrawing> flow_;
    std::vector<size_t> following_; // the next frame of each one's camera; their number: there is none
    size_t done_ = 0;
};

} // namespace semrover
