// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/image_size.h"
#include "engine/deferred/frame_images.h"
#include "engine/job/file_queue.h"
#include "engine/job/path_drawing.h"
#include "runtime/device/readback_ring.h"

namespace semrover {

// What a job leaves behind, on its way from the device into files while the next is made: a ring of read-backs, then
// threads that make files. These appear in the order in which they were asked for.
class Outgoing {
  public:
    // reads of at most `bytes` each; threads: of FileQueue
    static Result<std::unique_ptr<Outgoing>> create(Device& device, uint64_t bytes, uint32_t threads);
    static uint64_t planned_bytes(const DeviceLimits& limits, uint64_t bytes); // of device memory

    // `sink` is called on the thread of a later call here
    Status read(const DeviceTensor& slot, ReadbackRing::Sink sink) { return ring_->read(slot, std::move(sink)); }
    Status read(const FrameSlots& slots, const ImageSize& size, std::function<Status(FramePixels)> sink);
    // bytes: of host memory that `file` holds
    Status write(uint64_t bytes, FileQueue::Make file) { return files_.push(bytes, std::move(file)); }

    Status poll() { return ring_->poll(); }    // what has arrived goes on
    Status arrive() { return ring_->drain(); } // all that was read has reached its sink
    Status drain();                            // and all is written
    double file_wait_seconds() const { return files_.wait_seconds(); }

  private:
    Outgoing(std::unique_ptr<ReadbackRing> ring, uint32_t threads);

    std::unique_ptr<ReadbackRing> ring_;
    FileQueue files_;
};

} // namespace semrover
