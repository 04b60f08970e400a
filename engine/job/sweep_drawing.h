// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/scene_actors.h"

#include <functional>

namespace semrover {

// what the rays of a sweep meet; [beams, SweepPicture::width] row-major (engine/camera/lidar.h)
struct SweepImage {
    uint32_t width = 0;
    std::vector<float> alpha = {};  // sum of the weights of the splats on the ray
    std::vector<float> range = {};  // metres, to the splat with which alpha passes one half, else to the last
    std::vector<float> normal = {}; // [.., 3] weighted sum of normals in the sensor's axes, towards the sensor
    std::vector<uint32_t> label = {}, instance = {};

    uint64_t bytes() const { return 28 * uint64_t(alpha.size()); }
};

// Draws the sweeps of one lidar. A sweep is drawn in parts of less than half a turn, each of which is a camera of a
// rasterizer, without screen filter. Splats and actors must outlive it; the latter may become others, for which the
// options have room.
class SweepDrawing {
  public:
    // options: of the scene's pictures. Errors: out_of_memory
    static Result<std::unique_ptr<SweepDrawing>> create(Device& device, const SplatScene& splats,
                                                        const SceneActors& actors, std::shared_ptr<const Lidar> lidar,
                                                        RasterizerOptions options);

    // what a part has seen is on the device until `drawn` returns; a read of a ring that it starts is in time
    using Drawn = std::function<Status(uint32_t part, SplatSlots seen)>;
    Status draw(const LidarSweep& sweep, const Drawn& drawn);

    // what it sees, read back; waits for it
    Result<SweepImage> render(const LidarSweep& sweep);

    // puts one of a part's slots (SplatSlots::all) into an image of all parts
    SweepImage image() const;
    void put(uint32_t part, size_t slot, std::span<const std::byte> bytes, SweepImage& image) const;

    uint32_t parts() const { return parts_; }
    uint32_t rows() const { return rasterizer_->rows(); } // of the splats that it looks at
    static uint64_t largest_read(const Lidar& lidar);     // bytes of a slot

  private:
    SweepDrawing(Device& device, const SceneActors& actors, std::shared_ptr<const Lidar> lidar);
    CameraFrame frame_of(const LidarSweep& sweep, uint32_t part) const;
    SplatCamera camera_of(const CameraFrame& frame, uint32_t part) const;

    Device& device_;
    const SceneActors& actors_;
    std::shared_ptr<const Lidar> lidar_;
    SweepPicture picture_;
    uint32_t part_width_ = 0, parts_ = 0;
    std::unique_ptr<Rasterizer> rasterizer_;
};

} // namespace semrover
