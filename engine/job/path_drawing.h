// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/deferred/frame_images.h"
#include "engine/scene/grid.h"
#include "engine/splat/rasterizer.h"

#include <functional>
#include <map>
#include <optional>
#include <tuple>

namespace semrover {

// how points become pictures
struct DrawOptions {
    PointSplatOptions splats;
    std::array<uint8_t, 3> background{};
    std::optional<float> visible_alpha; // alpha from which a pixel counts as visible; 0.5, or what a model says
    bool semantic = false;              // in label colours; a grid without points as blocks

    RasterizerOptions rasterizer(const PictureEncoding& files = {}) const; // that keeps pixels as files have them
};

// Splats of a grid: points as generated, or as DrawOptions::semantic says. `name` is the grid's, for errors: bad_input
// for a grid without points, out_of_memory
Result<SplatScene> splats_of(Device& device, const VoxelGrid& grid, const Path& name, const DrawOptions& options);

// Draws a camera path in order, a moment a step: what the cameras of a rig see at one time is drawn in one submit, with
// one rasterizer for each image size and camera model. Pictures stay on the device, as files have them.
class PathDrawing {
  public:
    // the pixels are there until it returns; a read of a ring that it starts is in time
    using Drawn = std::function<Status(const CameraFrame&, const SplatPixelSlots&)>;

    // the scene must outlive it
    PathDrawing(Device& device, const SplatScene& scene, CameraPath path, const RasterizerOptions& options)
        : device_(device), scene_(scene), path_(std::move(path)), options_(options)
    {
    }

    // `drawn` gets every frame of the next moment; true when that was the last one. At least one frame must be left.
    Result<bool> step(const Drawn& drawn);
    std::span<const CameraFrame> next() const; // of the next moment
    bool skip();                               // it; true when that was the last one
    size_t done() const { return done_; }      // frames so far
    size_t total() const { return path_.frames.size(); }

    // frames of one size and camera model, which all move while they are read out, or none of which does; apart from
    // the path
    Status draw(std::span<const CameraFrame> frames, const Drawn& drawn);
    // one frame's images on the host, where the options keep no pixels; waits for them
    Result<SplatImage> image(const CameraFrame& frame);

  private:
    Result<Rasterizer*> rasterizer_of(const CameraFrame& like, uint32_t frames);

    Device& device_;
    const SplatScene& scene_;
    CameraPath path_;
    RasterizerOptions options_;
    size_t done_ = 0;
    std::map<std::tuple<uint32_t, uint32_t, CameraModel, bool>, std::unique_ptr<Rasterizer>> rasterizers_;
};

// where the pictures of a camera go: those of one without a name into the folder itself
Path camera_folder(const Path& folder, const std::string& camera);

} // namespace semrover
