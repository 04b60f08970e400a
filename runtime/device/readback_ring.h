// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/copy_ring.h"

#include <deque>
#include <functional>

namespace semrover {

// What slots hold, handed to a sink on the host while the device goes on: to write the files of one frame while the
// next is made. Sinks run in the order of the reads, inside a later call here, on the caller's thread.
class ReadbackRing {
  public:
    using Sink = std::function<Status(std::span<const std::byte>)>; // the bytes are good until it returns

    // `count` reads of `bytes` each are under way at a time at most
    static Result<std::unique_ptr<ReadbackRing>> create(Device& device, uint64_t bytes, size_t count = 3);
    static uint64_t planned_bytes(const DeviceLimits& limits, uint64_t bytes, size_t count = 3);

    // as the slot is after everything submitted so far; waits for the oldest read if there is no room
    Status read(const DeviceTensor& slot, Sink sink);
    Status poll();  // sinks of what has arrived
    Status drain(); // of all, waiting for it
    size_t pending() const { return reads_.size(); }
    void drop() { reads_.clear(); } // nobody wants them any more

  private:
    struct Read {
        uint64_t ticket = 0, bytes = 0;
        size_t place = 0;
        Sink sink;
    };
    explicit ReadbackRing(Device& device) : device_(device) {}
    Status deliver(); // the oldest

    Device& device_;
    std::unique_ptr<CopyRing> copies_;
    std::vector<std::unique_ptr<Buffer>> staging_;
    std::deque<Read> reads_;
    size_t next_ = 0;
};

} // namespace semrover
