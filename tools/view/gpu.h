// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover_vulkan.h"
#include "runtime/base/result.h"

#include <functional>
#include <memory>
#include <string>
#include <vulkan/vulkan.h>

namespace semrover::view {

// errors of Vulkan and of the library as ours. what: of the call; context: whose line says more
Status checked(VkResult result, const char* what);
Status checked(int sr_status, const sr_context* context);

// Memory of the viewer's own, freed with the object. The device outlives it.
struct Buffer {
    ~Buffer();
    VkDevice device = VK_NULL_HANDLE;
    VkBuffer handle = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    void* mapped = nullptr; // of those that the host reads or writes
};

struct Image {
    ~Image();
    VkDevice device = VK_NULL_HANDLE;
    VkImage handle = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkImageView view = VK_NULL_HANDLE;
};

struct GpuRequest {
    std::string device;     // name or index as `semrover devices` has them; empty: the best
    uint64_t max_bytes = 0; // of the library's memory; 0: no budget
    // with a window: its extensions, and its surface, which the device must be able to present to
    uint32_t extension_count = 0;
    const char* const* extensions = nullptr;
    std::function<VkResult(VkInstance, VkSurfaceKHR*)> make_surface;
};

// The viewer's Vulkan device, as a host has one, and a context of the library on it. One thread.
class Gpu {
  public:
    static Result<std::unique_ptr<Gpu>> create(const GpuRequest& request);
    ~Gpu();

    VkInstance instance() const { return instance_; }
    VkPhysicalDevice physical() const { return physical_; }
    VkDevice device() const { return device_; }
    VkQueue queue() const { return queue_; }
    uint32_t family() const { return family_; } // draws, computes and presents
    VkSurfaceKHR surface() const { return surface_; }
    sr_context* context() const { return context_; }

    Result<std::unique_ptr<Buffer>> buffer(VkDeviceSize bytes, VkBufferUsageFlags usage, bool mapped);
    // 8 bits a channel: red, green, blue, alpha
    Result<std::unique_ptr<Image>> image(uint32_t width, uint32_t height, VkImageUsageFlags usage);

    // Records, submits and waits. wait, signal: semaphores around it, or none
    Status run(const std::function<Status(VkCommandBuffer)>& record, VkSemaphore wait = VK_NULL_HANDLE,
               VkSemaphore signal = VK_NULL_HANDLE);
    sr_semaphore next_run() const { return {timeline_, runs_ + 1}; } // reached when the next one has ended

  private:
    Gpu() = default;
    Status open_instance(const GpuRequest& request);
    Status pick_device(const std::string& asked);
    bool find_family(VkPhysicalDevice physical);
    Status open_device();
    Status open_context(uint64_t max_bytes);
    Result<VkDeviceMemory> allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags wanted);

    VkInstance instance_ = VK_NULL_HANDLE;
    VkSurfaceKHR surface_ = VK_NULL_HANDLE;
    VkPhysicalDevice physical_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    uint32_t family_ = 0;
    bool float16_ = false;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkSemaphore timeline_ = VK_NULL_HANDLE; // run n reaches n
    uint64_t runs_ = 0;
    sr_context* context_ = nullptr;
};

} // namespace semrover::view
