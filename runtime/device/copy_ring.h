// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/command_ring.h"
#include "runtime/device/tensor_pool.h"

namespace semrover {

// Copies that nobody waits for, each in its place in the queue: after everything submitted before it, before everything
// that follows. A buffer that is freed meanwhile waits for it.
class CopyRing {
  public:
    static Result<std::unique_ptr<CopyRing>> create(Device& device, size_t count = 8);

    // between slots, or a slot and staging; of equal size. The ticket is for Device::wait.
    Result<uint64_t> copy(const BufferSlice& from, const BufferSlice& to);
    Result<uint64_t> copy(const DeviceTensor& from, const DeviceTensor& to) { return copy(from.slice(), to.slice()); }

  private:
    explicit CopyRing(Device& device) : device_(device) {}

    Device& device_;
    std::unique_ptr<CommandRing> commands_;
};

} // namespace semrover
