// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/command.h"
#include "runtime/device/command_ring.h"

namespace semrover {

// where a copy goes that an application sees: one of its buffers or images, of the device's queue family
struct HostTarget {
    VkBuffer buffer = VK_NULL_HANDLE;
    uint64_t offset = 0;
    HostImage image = {};
};

struct HostCopy {
    BufferSlice from;
    HostTarget to;
};

// into a command buffer that is being recorded. to.image: texels of the slice's rows, as many as it has
void record_host_target(const Device& device, VkCommandBuffer commands, const BufferSlice& from, const HostTarget& to);

// Copies what lies on the device into an application's memory, and back, and waits for it.
class HostCopies {
  public:
    static Result<std::unique_ptr<HostCopies>> create(Device& device);

    Status copy(std::span<const HostCopy> copies); // as record_host_target(), in one submit
    // as many bytes as the slice has, from a buffer with TRANSFER_SRC usage
    Status fetch(VkBuffer from, uint64_t offset, const BufferSlice& to);
    Status fetch(const HostImage& from, const BufferSlice& to); // pixels, row by row

  private:
    explicit HostCopies(Device& device) : device_(device) {}
    Status submit();

    Device& device_;
    std::unique_ptr<CommandRing> commands_;
};

} // namespace semrover
