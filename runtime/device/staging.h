// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/command_ring.h"

#include <array>
#include <vector>

namespace semrover {

// What goes between the host and memory that it does not see: a window of two halves. One is filled or emptied while
// the device copies the other. Nobody waits for what is written: copies have their place in the queue, after everything
// that was submitted before, before everything that follows.
class Staging {
  public:
    static Result<std::unique_ptr<Staging>> create(Device& device, uint64_t bytes);

    Status write(const BufferSlice& to, std::span<const std::byte> bytes);
    Status clear(const BufferSlice& slice);
    Status read(std::span<const BufferSlice> from,
                const PieceSink& sink); // see Device::read; returns when all is there

    // piecewise: where the caller puts what goes to `to`, of half_bytes() at most, until flush() or until room is
    // needed
    Result<std::span<std::byte>> room(const BufferSlice& to);
    Status flush();                   // submits what was put
    void drop() { pending_.clear(); } // what was put and not submitted
    uint64_t half_bytes() const { return window_->bytes() / kHalves / 16 * 16; }

  private:
    explicit Staging(Device& device) : device_(device) {}
    struct Copy {
        BufferSlice from, to;
    };
    BufferSlice part(uint64_t at, uint64_t bytes) const;
    Status begin_half(); // waits until the device is done with the current one

    static constexpr size_t kHalves = 2;
    Device& device_;
    std::unique_ptr<Buffer> window_;
    std::unique_ptr<CommandRing> commands_;
    std::array<uint64_t, kHalves> tickets_{}; // of the last copies out of each half, or into it
    size_t half_ = 0;                         // the current one
    uint64_t used_ = 0;                       // bytes of it
    std::vector<Copy> pending_;
};

} // namespace semrover
