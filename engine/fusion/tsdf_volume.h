// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/depth_frames.h"
#include "kernels/fusion.h"
#include "kernels/network.h"
#include "runtime/base/result.h"
#include "runtime/device/device.h"
#include "runtime/device/tensor_pool.h"

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
    TensorPool state_;
    DeviceTensor table_, pixels_;
};

// The truncated signed distance of depth images, in sparse blocks of 8^3 voxels in device memory. Distances are taken
// to the plane through a pixel. A voxel in front of the surface counts as free space however far in front it lies (in
// blocks that exist), with the distance cut at one truncation; behind the surface evidence ends after half a
// truncation, and after two truncations along the ray. The result depends neither on how blocks are divided into chunks
// nor on how frames are divided into batches.
class TsdfVolume {
  public:
    // Errors: bad_input for cameras more than 10 km apart or 1000 km from the origin, or when no pixel saw anything;
    // out_of_memory; what loading a frame says
    static Result<TsdfVolume> create(Device& device, const DepthFrames& frames, const FusionOptions& options,
                                     const FusionProgress& progress = {});

    const FusionBox& box() const { return box_; }
    const std::vector<uint32_t>& blocks() const { return blocks_; } // ids in the box, x fastest, ascending
    uint32_t chunks() const { return chunks_; }
    MarchingCubesField in(Graph& g) const;

  private:
    struct ChunkState; // sums and votes of the blocks of a chunk

    TsdfVolume(Device& device, const FusionOptions& options) : device_(&device), options_(options) {}
    Status plan_box(const DepthFrames& frames);
    Status touch(const DepthFrames& frames, FrameBatch& batch, const FusionProgress& progress);
    Status list_blocks();
    Status integrate(const DepthFrames& frames, FrameBatch& batch, const FusionProgress& progress);
    Status integrate_chunk(const DepthFrames& frames, FrameBatch& batch, const ChunkState& state, uint32_t first,
                           uint32_t count, const std::function<Status(size_t)>& added);
    Result<uint32_t> chunk_blocks(const FrameBatch& batch) const;
    std::vector<uint32_t> frames_near(uint32_t first, uint32_t count) const;
    TsdfOptions kernel_options() const;

    Device* device_;
    FusionOptions options_;
    FusionBox box_;
    struct Reach { // blocks of the box that a frame may see
        std::array<int64_t, 3> low, high;
    };
    std::vector<Reach> reach_; // of each frame
    TensorPool box_state_, field_;
    DeviceTensor bitmap_, ranks_, total_;             // of the box
    DeviceTensor block_ids_, distances_, attributes_; // of the field
    std::vector<uint32_t> blocks_;
    uint32_t chunks_ = 0;
};

} // namespace semrover
