// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/copy_ring.h"

namespace semrover {

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
