// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/drawn_scene.h"

#include <map>
#include <tuple>

namespace semrover {

// One rasterizer for each kind of frame: image size, camera model, and whether the camera, or an actor, moves while it
// is read out.
class FrameRasterizers {
  public:
    // the scene outlives it
    FrameRasterizers(Device& device, const DrawnScene& scene, const RasterizerOptions& options)
        : device_(device), scene_(scene), options_(options)
    {
    }

    bool moving(const CameraFrame& frame) const { return scene_.actors.moving(frame); }
    // for up to as many frames of a kind at a time as the first call has
    Result<Rasterizer*> of(const CameraFrame& like, uint32_t frames);
    // one frame, where the options keep no pixels; its images stay until the next of its kind
    Result<SplatSlots> draw(const CameraFrame& frame);

  private:
    Device& device_;
    const DrawnScene& scene_;
    RasterizerOptions options_;
    std::map<std::tuple<uint32_t, uint32_t, CameraModel, bool>, std::unique_ptr<Rasterizer>> rasterizers_;
};

} // namespace semrover
