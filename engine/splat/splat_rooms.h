// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/splat_scene.h"
#include "runtime/device/executable.h"

namespace semrover {

// Makes splats of few points again and again, as of the tiles of a world. A room is memory and executable for as many
// points as a power of two, made once for each size and options, and used again.
class SplatRooms {
  public:
    explicit SplatRooms(Device& device) : device_(device) {}

    // makes the room, so that record() does not. Errors: as SplatScene::create() has them; out_of_memory
    Status prepare(size_t points, const PointSplatOptions& options);

    // Records into `commands`, which must be submitted next: splats of points, bit for bit those that
    // SplatScene::create() makes, good until the room is recorded again. Those from `shown` on are only neighbours of
    // the others: they, and all behind them, have no opacity. Waits until the device has read what the room was given
    // before. Errors: as prepare()'s
    Result<const SplatScene*> record(VkCommandBuffer commands, const ScenePoints& points, size_t shown,
                                     const PointSplatOptions& options);

  private:
    struct Room {
        PointSplatOptions options;
        SplatScene scene;
        std::unique_ptr<Buffer> upload; // positions, colours, labels and voxels, one after the other
        std::unique_ptr<Executable> executable;
        uint64_t busy_until = 0; // a ticket
    };
    Result<Room*> room_for(size_t points, const PointSplatOptions& options);

    Device& device_;
    std::vector<std::unique_ptr<Room>> rooms_;
};

} // namespace semrover
