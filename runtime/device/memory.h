// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "runtime/device/vulkan.h"
#include "runtime/graph/buffer_slice.h"

#include <cstddef>
#include <memory>
#include <vector>

namespace semrover {

class Device;

// device: what kernels read and write. staging: what the host sees, and copies pass through. transfer: staging that the
// budget (--max-vram) does not count, as no plan has it: the device's one window of 16 MiB, where it needs any.
enum class MemoryKind : uint8_t { device, staging, transfer };

// one VkBuffer with memory of its own; usable as storage, texel buffer, and transfer source and target
class Buffer {
  public:
    ~Buffer(); // after everything submitted so far
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;

    // errors: out_of_memory when the device, its largest allocation, or the budget (--max-vram) refuses
    static Result<std::unique_ptr<Buffer>> create(Device& device, uint64_t bytes, MemoryKind kind, const char* name);

    VkBuffer handle() const { return buffer_; }
    uint64_t bytes() const { return bytes_; }
    std::byte* mapped() const { return mapped_; } // null where the host cannot see it
    bool cached() const { return cached_; }       // the host's reads are cached: else they are slow
    BufferSlice slice() const { return {this, 0, bytes_}; }

  private:
    Buffer(Device& device) : device_(device) {}

    Device& device_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    uint64_t bytes_ = 0, accounted_ = 0;
    std::byte* mapped_ = nullptr;
    bool cached_ = false;
};

} // namespace semrover
