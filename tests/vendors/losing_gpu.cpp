// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan layer that loses devices, as a driver does after a hang: the first LOSING_GPU_DEVICES devices of the process
// (1 where it is not set) take LOSING_GPU_SUBMITS submits; from then on each submit and each wait is
// VK_ERROR_DEVICE_LOST. Everything else is the driver's.
#include "tests/vendors/layer.h"

#include <atomic>
#include <cstdlib>
#include <map>

namespace {

std::atomic<int> devices = 0, submits = 0;

int number_of(const char* name, int otherwise)
{
    const char* text = std::getenv(name);
    return text ? std::atoi(text) : otherwise;
}

bool lost()
{
    static const int losing = number_of("LOSING_GPU_DEVICES", 1), taken = number_of("LOSING_GPU_SUBMITS", 0);
    return devices <= losing && submits > taken;
}

// what the driver still runs ends first: it would write to memory that the program frees
VkResult lose()
{
    driver.of_device<PFN_vkDeviceWaitIdle>("vkDeviceWaitIdle")(driver.device);
    return VK_ERROR_DEVICE_LOST;
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue queue, uint32_t count, const VkSubmitInfo* infos, VkFence fence)
{
    ++submits;
    return lost() ? lose() : driver.of_device<PFN_vkQueueSubmit>("vkQueueSubmit")(queue, count, infos, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL wait_semaphores(VkDevice device, const VkSemaphoreWaitInfo* info, uint64_t timeout)
{
    return lost() ? lose() : driver.of_device<PFN_vkWaitSemaphores>("vkWaitSemaphores")(device, info, timeout);
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkDevice* device)
{
    const VkResult result = create_next_device(physical, *info, *info, allocator, device);
    ++devices;
    submits = 0;
    return result;
}

PFN_vkVoidFunction ours(std::string_view name)
{
    static const std::map<std::string_view, PFN_vkVoidFunction> functions = {
        {"vkCreateDevice", any(create_device)},
        {"vkQueueSubmit", any(submit)},
        {"vkWaitSemaphores", any(wait_semaphores)},
    };
    const auto found = functions.find(name);
    return found == functions.end() ? nullptr : found->second;
}

} // namespace
