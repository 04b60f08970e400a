// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/deferred/latent_size.h"
#include "engine/format/depth_picture.h"
#include "kernels/splat.h"
#include "runtime/device/copy_ring.h"
#include "runtime/device/executable.h"

namespace semrover {

// Accumulates the frames of a chain in time (docs/method.md §6.5), so that they flicker less: a frame takes a share of
// the one before where depth and cameras say that both show the same surface. It works on the bytes that files hold, so
// a chain that is taken up again goes on to the same bytes.
class FrameHistory {
  public:
    // model: of the first frame's lens; share: of the frame before, 0..1. Errors: out_of_memory; device errors
    static Result<std::unique_ptr<FrameHistory>> create(Device& device, const LatentSize& size, CameraModel model,
                                                        float share);

    // The next frame of the chain, until keep(): what fails may be added again, and what was not kept is replaced. The
    // first one stays as it is, and so does one through another lens than the frame before. bytes: as picture_bytes()
    // makes them, pixels: [height, width, 3]; depth: nothing is infinitely far away
    Status add(const DeviceTensor& bytes, const CameraFrame& camera, const DepthPicture& depth);
    Status add(std::span<const uint8_t> pixels, const CameraFrame& camera, const DepthPicture& depth);
    void keep();    // the one that was added last
    void restart(); // the next frame has none before it
    // a frame that was accumulated before: what comes next goes on from it
    Status restore(std::span<const uint8_t> pixels, const CameraFrame& camera, const DepthPicture& depth);

    const DeviceTensor& frame() const { return memory_.made; } // [picture_words()] u32, of the one that was added last

    // of device memory
    static uint64_t planned_bytes(const DeviceLimits& limits, const LatentSize& size);

  private:
    struct Frame {
        DeviceTensor bytes, depth;
    };
    // memory that is declared, and the graph over it
    struct Memory {
        LatentSize size;
        TensorPool state;
        DeviceTensor cameras, made;
        Frame now, past;

        explicit Memory(const LatentSize& size);
        Graph graph(const DeviceLimits& limits, SplatLens lens, bool moving, float share) const;
    };
    FrameHistory(Device& device, const LatentSize& size, float share) : device_(device), memory_(size), share_(share) {}
    Status use_lens(CameraModel model, bool moving);
    Status copy(const DeviceTensor& from, const DeviceTensor& to);
    Status write_pixels(std::span<const uint8_t> pixels);
    Status accumulate_now(const CameraFrame& camera, const DepthPicture& depth);

    Device& device_;
    Memory memory_;
    float share_;
    CameraModel model_ = CameraModel::pinhole; // of the executable
    bool moving_ = false;                      // likewise
    std::unique_ptr<Executable> executable_;
    std::unique_ptr<CopyRing> copies_;
    CameraFrame camera_, added_; // of the last frame that was kept, and of the one that was added
    uint32_t frames_ = 0;        // that were kept
    bool before_ = false;        // memory has the last one as the frame before
};

} // namespace semrover
