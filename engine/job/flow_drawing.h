// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/image_size.h"
#include "engine/job/scene_actors.h"
#include "runtime/device/copy_ring.h"

namespace semrover {

// optical flow from a frame to the next one of its camera, as FlowTensors (kernels/picture.h) has it
struct FlowSlots {
    Slot flow, states;
};

// For each frame of a path the next one of its camera, to which there is flow; the number of frames where there is
// none: after the last, and where lens model or size change
std::vector<size_t> following_frames(const CameraPath& path);

// Draws what optical flow needs of a frame and of the next: depths and owners. What was drawn of a camera's next frame
// is used again when that is the frame.
class FlowDrawing {
  public:
    // scene and actors outlive it
    FlowDrawing(Device& device, const SplatScene& scene, const SceneActors& actors, const RasterizerOptions& options);

    // The flow stays until the next call; a read of a ring that begins before is in time. Frames of one camera model
    // and size. Errors: out_of_memory; device errors
    Result<FlowSlots> flow(const CameraFrame& now, const CameraFrame& next);

  private:
    struct View {
        Slot depth, owners;
        std::optional<std::pair<double, Rigid>> of; // time and pose of the frame that it has
    };
    struct Camera {
        State state;
        View now, next;
        CameraModel model = CameraModel::pinhole;
        Slot lenses, moves, rows, flow, flow_states;
        std::unique_ptr<Rasterizer> rasterizer;
        std::unique_ptr<Program> forward, backward; // from now to next, and from next to now
    };
    Status make(Camera& camera, const Intrinsics& intrinsics);
    Result<std::unique_ptr<Program>> make_program(const Camera& c, const View& from, const View& to,
                                                  const Intrinsics& intrinsics);
    Status draw(Camera& camera, const CameraFrame& frame, View& view);

    Device& device_;
    const SplatScene& scene_;
    const SceneActors& actors_;
    RasterizerOptions options_;
    std::unique_ptr<CopyRing> copies_;
    std::map<std::string, Camera> cameras_;
};

} // namespace semrover
