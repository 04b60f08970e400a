// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"

#include <array>

// What another API of the same GPU, such as OpenGL, is given by file descriptor: memory (MemoryKind::exportable) and
// semaphores (VK_KHR_external_memory_fd, VK_KHR_external_semaphore_fd).
namespace semrover {

constexpr VkBufferUsageFlags kExportedUsage =
    VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;

// which of the extensions a physical device has, and can export buffers and binary semaphores with
Exportable exportable_of(const VulkanCalls& vk, VkPhysicalDevice physical);

// a buffer that is exported needs an allocation of its own
bool needs_dedicated_memory(const Device& device);

// Both must be the same in the API that imports.
struct DriverIds {
    std::array<uint8_t, VK_UUID_SIZE> device, driver;
    bool operator==(const DriverIds&) const = default;
};
DriverIds driver_ids(const Device& device);

// A binary semaphore for another API: each signal is waited for once. Works as a point of a submit, with any value.
class ExportedSemaphore {
  public:
    static Result<std::unique_ptr<ExportedSemaphore>> create(Device& device);
    ~ExportedSemaphore(); // after everything submitted so far
    ExportedSemaphore(const ExportedSemaphore&) = delete;
    ExportedSemaphore& operator=(const ExportedSemaphore&) = delete;

    TimelinePoint point() const { return {semaphore_, 0}; }
    Result<int> descriptor() const; // a new one, which the caller owns

  private:
    explicit ExportedSemaphore(Device& device) : device_(device) {}

    Device& device_;
    VkSemaphore semaphore_ = VK_NULL_HANDLE;
};

} // namespace semrover
