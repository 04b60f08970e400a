// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/command.h"
#include "runtime/device/command_ring.h"

namespace semrover {

// where a copy goes that an application sees: one of its buffers or images, of the device's queue family
struct ExternalTarget {
    VkBuffer buffer = VK_NULL_HANDLE;
    uint64_t offset = 0;
    ExternalImage image = {};
};

struct ExternalCopy {
    BufferSlice from;
    ExternalTarget to;
};

// into a command buffer that is being recorded. to.image: texels of the slice's rows, as many as it has
void record_external_target(const Device& device, VkCommandBuffer commands, const BufferSlice& from,
                            const ExternalTarget& to);

// Copies what lies on the device into an application's memory, and back, and waits for it.
class ExternalCopies {
  public:
    static Result<std::unique_ptr<ExternalCopies>> create(Device& device);

    Status copy(std::span<const ExternalCopy> copies); // as record_external_target(), in one submit
    // as many bytes as the slice has, from a buffer with TRANSFER_SRC usage
    Status fetch(VkBuffer from, uint64_t offset, const BufferSlice& to);
    Status fetch(const ExternalImage& from, const BufferSlice& to); // pixels, row by row

  private:
    explicit ExternalCopies(Device& device) : device_(device) {}
    Status submit();

    Device& device_;
    std::unique_ptr<CommandRing> commands_;
};

} // namespace semrover
