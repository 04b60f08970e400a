// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan layer under which the driver's device has another name, and its driver another version. Everything else is
// the driver's.
#include "tests/vendors/layer.h"

#include <cstdio>

namespace {

VKAPI_ATTR void VKAPI_CALL get_properties(VkPhysicalDevice physical, VkPhysicalDeviceProperties2* properties)
{
    driver.of_instance<PFN_vkGetPhysicalDeviceProperties2>("vkGetPhysicalDeviceProperties2")(physical, properties);
    auto& name = properties->properties.deviceName;
    std::snprintf(name, sizeof name, "another GPU");
    for (auto* next = static_cast<VkBaseOutStructure*>(properties->pNext); next; next = next->pNext)
        if (next->sType == VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES) {
            auto& version = reinterpret_cast<VkPhysicalDeviceVulkan12Properties*>(next)->driverInfo;
            std::snprintf(version, sizeof version, "another version");
        }
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkDevice* device)
{
    return create_next_device(physical, *info, *info, allocator, device);
}

PFN_vkVoidFunction ours(std::string_view name)
{
    if (name == "vkCreateDevice")
        return any(create_device);
    return name == "vkGetPhysicalDeviceProperties2" ? any(get_properties) : nullptr;
}

} // namespace
