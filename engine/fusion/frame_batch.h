// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/depth_frames.h"
#include "kernels/fusion.h"
#include "kernels/network.h"
#include "runtime/base/result.h"
#include "runtime/device/device.h"
#include "runtime/device/state.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

namespace semrover {

struct FusionOptions {
    double voxel = 0.1;     // metres
    double truncation = 4;  // voxels; a pixel colours and votes within half of it
    double max_depth = 30;  // metres; pixels beyond it are not used
    double min_weight = 0;  // of a voxel, else it is unobserved; a frame adds at most 1 / (1 + z)
    uint32_t min_views = 2; // frames that saw a cell's surface, else it is dropped; at most 7
    // voxels between the distances of a cell's corners: a surface that was seen makes at most 1.8, the edge of what it
    // hides more. Where they are further apart there is no surface, for nobody saw it; what is as thin as two voxels
    // loses much of itself.
    double max_jump = 3.2;
    uint32_t excluded = 1u << 10;  // bit per class: pixels that are not used; sky
    uint32_t max_chunk_blocks = 0; // blocks of 8^3 voxels whose votes are kept at a time; 0: what memory allows
};

// called after each part of the work; an error stops it
using FusionProgress = std::function<Status(const char* stage, size_t done, size_t total)>;

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
