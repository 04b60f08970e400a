// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
//
// A Vulkan layer that loses devices, as a driver does after a hang: the first LOSING_GPU_DEVICES devices of the process
// (1 where it is not set) take LOSING_GPU_SUBMITS submits; from then on each submit and each wait is
// VK_ERROR_DEVICE_LOST. Everything else is the driver's.
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <map>
#include <string_view>

namespace {

PFN_vkGetInstanceProcAddr next_instance_proc = nullptr;
PFN_vkGetDeviceProcAddr next_device_proc = nullptr;
VkInstance instance_made = VK_NULL_HANDLE;
VkDevice device_made = VK_NULL_HANDLE; // one at a time: what a program of ours opens
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
    reinterpret_cast<PFN_vkDeviceWaitIdle>(next_device_proc(device_made, "vkDeviceWaitIdle"))(device_made);
    return VK_ERROR_DEVICE_LOST;
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue queue, uint32_t count, const VkSubmitInfo* infos, VkFence fence)
{
    ++submits;
    if (lost())
        return lose();
    return reinterpret_cast<PFN_vkQueueSubmit>(next_device_proc(device_made, "vkQueueSubmit"))(queue, count, infos,
                                                                                               fence);
}

VKAPI_ATTR VkResult VKAPI_CALL wait_semaphores(VkDevice device, const VkSemaphoreWaitInfo* info, uint64_t timeout)
{
    if (lost())
        return lose();
    return reinterpret_cast<PFN_vkWaitSemaphores>(next_device_proc(device, "vkWaitSemaphores"))(device, info, timeout);
}

// where the loader says what comes next in the chain
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
    next_instance_proc = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkResult result = reinterpret_cast<PFN_vkCreateInstance>(
        next_instance_proc(VK_NULL_HANDLE, "vkCreateInstance"))(info, allocator, instance);
    instance_made = *instance;
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkDevice* device)
{
    auto* link = link_of<VkLayerDeviceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    next_device_proc = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkResult result = reinterpret_cast<PFN_vkCreateDevice>(next_instance_proc(instance_made, "vkCreateDevice"))(
        physical, info, allocator, device);
    device_made = *device;
    ++devices;
    submits = 0;
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_proc(VkInstance instance, const char* name);
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_proc(VkDevice device, const char* name);

template <typename F>
PFN_vkVoidFunction any(F function)
{
    return reinterpret_cast<PFN_vkVoidFunction>(function);
}

PFN_vkVoidFunction ours(std::string_view name)
{
    static const std::map<std::string_view, PFN_vkVoidFunction> functions = {
        {"vkGetInstanceProcAddr", any(instance_proc)},
        {"vkGetDeviceProcAddr", any(device_proc)},
        {"vkCreateInstance", any(create_instance)},
        {"vkCreateDevice", any(create_device)},
        {"vkQueueSubmit", any(submit)},
        {"vkWaitSemaphores", any(wait_semaphores)},
    };
    const auto found = functions.find(name);
    return found == functions.end() ? nullptr : found->second;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_proc(VkInstance instance, const char* name)
{
    const PFN_vkVoidFunction function = ours(name);
    return function || !next_instance_proc ? function : next_instance_proc(instance, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_proc(VkDevice device, const char* name)
{
    const PFN_vkVoidFunction function = ours(name);
    return function ? function : next_device_proc(device, name);
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
