// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/scene_actors.h"
#include "engine/splat/camera_pair.h"
#include "runtime/device/copy_ring.h"

#include <functional>
#include <map>

namespace semrover {

// optical flow from a frame to the next one of its camera, as FlowTensors (kernels/picture.h) has it
struct FlowSlots {
    DeviceTensor flow, states;
};

// For each frame of a path the next one of its camera, to which there is flow; the number of frames where there is
// none: after the last, and where lens model or size change
std::vector<size_t> following_frames(const CameraPath& path);

// Optical flow needs depths and owners of a frame and of the next. What was drawn of a camera's next frame is used
// again when that is the frame.
class FlowDrawing {
  public:
    // draws a frame: depths and owners, whole, as surface_options() has them; they stay until it draws the next one
    using Draw = std::function<Result<SplatSlots>(const CameraFrame&)>;
    static RasterizerOptions surface_options(RasterizerOptions options);

    // actors: they outlive it, and may become others
    FlowDrawing(Device& device, const SceneActors& actors, Draw draw);

    // The flow stays until the next call; a read of a ring that begins before is in time. Frames of one camera model
    // and size. Errors: out_of_memory; device errors
    Result<FlowSlots> flow(const CameraFrame& now, const CameraFrame& next);
    void forget();                                     // what was drawn: the scene is another one
    size_t cameras() const { return cameras_.size(); } // that it has memory and executables for, by name

  private:
    using Place = std::pair<double, Rigid>; // time and pose
    struct View {
        DeviceTensor depth, owners;
        std::optional<Place> of; // the frame that it has
    };
    struct Camera {
        TensorPool state;
        std::array<View, 2> views;
        DeviceTensor cameras, moves, rows, flow, flow_states;
        CameraModel model = CameraModel::pinhole; // that the executables are for
        bool moving = false;
        std::array<std::unique_ptr<Executable>, 2> executables; // from each view to the other
    };
    Status allocate(Camera& camera, uint32_t pixels);
    Status compile(Camera& camera, const CameraPair& pair, const ImageSize& size);
    Status draw(const CameraFrame& frame, View& view);

    Device& device_;
    const SceneActors& actors_;
    Draw draw_;
    std::unique_ptr<CopyRing> copies_;
    std::map<std::string, Camera> cameras_;
};

} // namespace semrover
