// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "runtime/device/vulkan.h"
#include "runtime/graph/buffer_slice.h"

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

namespace semrover {

class Device;

// device: what kernels read and write. staging: what the host sees, and copies pass through. transfer: staging that the
// budget (--max-vram) does not count, as no plan has it: the device's one window of 16 MiB, where it needs any.
// exportable: what another API sees, too (Device::exportable); only copied to and from.
enum class MemoryKind : uint8_t { device, staging, transfer, exportable };

// memory of an application's allocator
struct MemoryRequest {
    uint64_t bytes = 0, alignment = 1;
    uint32_t type = 0;   // index of VkMemoryType
    bool mapped = false; // the host shall see it
};
struct MemoryPiece {
    VkDeviceMemory memory = VK_NULL_HANDLE;
    uint64_t offset = 0;
    void* mapped = nullptr;
    void* handle = nullptr; // the allocator's own
};
struct MemorySource {
    std::function<Result<MemoryPiece>(const MemoryRequest&)> allocate = {};
    std::function<void(const MemoryPiece&)> release = {};
};

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

    // of MemoryKind::exportable: a new file descriptor of the memory, which the caller owns; its size; whether whoever
    // imports it must be told that the memory is this buffer's alone
    Result<int> descriptor() const;
    uint64_t memory_bytes() const { return memory_bytes_; }
    bool dedicated() const { return dedicated_; }

  private:
    Buffer(Device& device) : device_(device) {}

    Status make_handle(MemoryKind kind);
    Status make_memory(MemoryKind kind, const char* name);
    Status allocate(const VkMemoryRequirements& needs, uint32_t type, bool seen, const char* name);
    Status borrow(const VkMemoryRequirements& needs, uint32_t type, bool seen, const char* name);

    Device& device_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE; // our own, or
    MemoryPiece piece_;                      // the application allocator's
    uint64_t bytes_ = 0, memory_bytes_ = 0, accounted_ = 0;
    std::byte* mapped_ = nullptr;
    bool cached_ = false, exportable_ = false, dedicated_ = false;
};

} // namespace semrover
