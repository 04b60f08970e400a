// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <algorithm>
#include <string_view>

// What a Vulkan layer of the tests has beside its own functions. Each layer is one source, which includes this once and
// defines ours().
namespace {

// what the next layer, or the driver, offers
struct Driver {
    PFN_vkGetInstanceProcAddr instance_proc = nullptr;
    PFN_vkGetDeviceProcAddr device_proc = nullptr;
    VkInstance instance = VK_NULL_HANDLE;
    VkDevice device = VK_NULL_HANDLE;

    template <typename F>
    F of_instance(const char* name) const
    {
        return reinterpret_cast<F>(instance_proc(instance, name));
    }
    template <typename F>
    F of_device(const char* name) const
    {
        return reinterpret_cast<F>(device_proc(device, name));
    }
};
Driver driver; // one instance and one device at a time: what a program of ours opens

// the layer's own function of that name, or null
PFN_vkVoidFunction ours(std::string_view name);

template <typename F>
PFN_vkVoidFunction any(F function)
{
    return reinterpret_cast<PFN_vkVoidFunction>(function);
}

// where the loader says what comes next in the chain; null if it does not
template <typename Link, typename Info>
Link* link_of(const Info* info, VkStructureType type)
{
    auto* link = static_cast<const Link*>(info->pNext);
    while (link && !(link->sType == type && link->function == VK_LAYER_LINK_INFO))
        link = static_cast<const Link*>(link->pNext);
    return const_cast<Link*>(link);
}

VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* allocator,
                                               VkInstance* instance)
{
    auto* link = link_of<VkLayerInstanceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    driver.instance_proc = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto make = reinterpret_cast<PFN_vkCreateInstance>(driver.instance_proc(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = make(info, allocator, instance);
    driver.instance = *instance;
    return result;
}

// loader: what the loader gave, with its chain; info: what is asked for
VkResult create_next_device(VkPhysicalDevice physical, const VkDeviceCreateInfo& loader, const VkDeviceCreateInfo& info,
                            const VkAllocationCallbacks* allocator, VkDevice* device)
{
    auto* link = link_of<VkLayerDeviceCreateInfo>(&loader, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    driver.device_proc = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkResult result =
        driver.of_instance<PFN_vkCreateDevice>("vkCreateDevice")(physical, &info, allocator, device);
    driver.device = *device;
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_proc(VkDevice device, const char* name)
{
    const PFN_vkVoidFunction function = ours(name);
    return function ? function : driver.device_proc(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_proc(VkInstance instance, const char* name)
{
    const std::string_view asked = name;
    if (asked == "vkGetInstanceProcAddr")
        return any(instance_proc);
    if (asked == "vkGetDeviceProcAddr")
        return any(device_proc);
    if (const PFN_vkVoidFunction function = ours(asked))
        return function;
    if (asked == "vkCreateInstance")
        return any(create_instance);
    return driver.instance_proc ? driver.instance_proc(instance, name) : nullptr;
}

} // namespace

extern "C" VK_LAYER_EXPORT VkResult VKAPI_CALL vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* loader)
{
    loader->loaderLayerInterfaceVersion = std::min(loader->loaderLayerInterfaceVersion, 2u);
    loader->pfnGetInstanceProcAddr = instance_proc;
    loader->pfnGetDeviceProcAddr = device_proc;
    loader->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
