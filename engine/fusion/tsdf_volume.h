// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/fusion/frame_batch.h"

namespace semrover {

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
    State box_state_, field_;
    Slot bitmap_, ranks_, total_;             // of the box
    Slot block_ids_, distances_, attributes_; // of the field
    std::vector<uint32_t> blocks_;
    uint32_t chunks_ = 0;
};

} // namespace semrover
