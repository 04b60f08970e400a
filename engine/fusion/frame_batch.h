// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/depth_frames.h"
#include "engine/fusion/fusion_options.h"
#include "kernels/fusion.h"
#include "kernels/network.h"
#include "runtime/device/device.h"
#include "runtime/device/state.h"

#include <memory>
#include <span>

namespace semrover {

// where a box of voxels lies in the world
struct FusionBox {
    double voxel = 0;             // metres
    std::array<int64_t, 3> low{}; // voxels, multiples of 8
    std::array<uint32_t, 3> blocks{};
};

// a few frames in device memory: a table of cameras, and their pixels
class FrameBatch {
  public:
    // room for the largest frame at least
    static Result<FrameBatch> create(Device& device, const DepthFrames& frames);

    // of `order`, from `next` on, as many as fit; returns how many
    size_t fitting(const DepthFrames& frames, std::span<const uint32_t> order, size_t next) const;
    Status upload(const DepthFrames& frames, const FusionBox& box, std::span<const uint32_t> batch, uint32_t excluded);

    TsdfFrames in(Graph& g) const;
    uint32_t pixels() const { return pixels_.rows(); }

  private:
    explicit FrameBatch(Device& device) : device_(&device) {}

    Device* device_;
    State state_;
    Slot table_, pixels_;
};

} // namespace semrover
