// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/command_ring.h"
#include "runtime/device/state.h"

namespace semrover {

// Copies that nobody waits for, each in its place in the queue: after everything submitted before it, before everything
// that follows. A buffer that is freed meanwhile waits for it.
class CopyRing {
  public:
    static Result<std::unique_ptr<CopyRing>> create(Device& device, size_t count = 8);

    // between slots, or a slot and staging; of equal size. The ticket is for Device::wait.
    Result<uint64_t> copy(const BufferSlice& from, const BufferSlice& to);
    Result<uint64_t> copy(const Slot& from, const Slot& to) { return copy(from.slice(), to.slice()); }

  private:
    explicit CopyRing(Device& device) : device_(device) {}

    Device& device_;
    std::unique_ptr<CommandRing> commands_;
};

// What goes between the host and memory that it does not see: a window of two halves. One is filled or emptied while
// the device copies the other.
class Staging {
  public:
    static Result<std::unique_ptr<Staging>> create(Device& device, uint64_t bytes);

    // return when all is there
    Status write(const BufferSlice& to, std::span<const std::byte> bytes);
    Status read(std::span<const BufferSlice> from, const PieceSink& sink); // see Device::read

  private:
    explicit Staging(Device& device) : device_(device) {}
    uint64_t half_bytes() const { return window_->bytes() / kHalves / 16 * 16; }
    BufferSlice half(size_t index, uint64_t bytes) const;

    static constexpr size_t kHalves = 2;
    Device& device_;
    std::unique_ptr<Buffer> window_;
    std::unique_ptr<CopyRing> copies_;
};

} // namespace semrover
