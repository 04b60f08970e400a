// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/command.h"
#include "runtime/device/device.h"

namespace semrover {

// where a copy goes that a host program sees: one of its buffers or images, of the device's queue family
struct HostTarget {
    VkBuffer buffer = VK_NULL_HANDLE;
    uint64_t offset = 0;
    HostImage image = {};
};

// Copies what lies on the device into a host program's memory, and back, and waits for it.
class HostCopies {
  public:
    static Result<std::unique_ptr<HostCopies>> create(Device& device);
    ~HostCopies();
    HostCopies(const HostCopies&) = delete;
    HostCopies& operator=(const HostCopies&) = delete;

    // to.image: texels of the slice's rows, as many as it has
    Status copy(const BufferSlice& from, const HostTarget& to);
    // as many bytes as the slice has, from a buffer with TRANSFER_SRC usage
    Status fetch(VkBuffer from, uint64_t offset, const BufferSlice& to);

  private:
    explicit HostCopies(Device& device) : device_(device) {}
    Status submit();

    Device& device_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

} // namespace semrover
