// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/vulkan_calls.h"

namespace semrover {

namespace {

template <typename Call>
Status set(Call& call, PFN_vkVoidFunction found, const char* name)
{
    call = reinterpret_cast<Call>(found);
    if (!call)
        return fail(ErrorCode::no_device, "this Vulkan has no {}", name);
    return {};
}

} // namespace

Status VulkanCalls::load_instance(PFN_vkGetInstanceProcAddr get, VkInstance instance)
{
    GetInstanceProcAddr = get ? get : vkGetInstanceProcAddr;
#define SR_LOAD(name) SR_CHECK(set(name, GetInstanceProcAddr(instance, "vk" #name), "vk" #name));
    SR_INSTANCE_CALLS(SR_LOAD)
#undef SR_LOAD
    return {};
}

Status VulkanCalls::load_device(VkDevice device)
{
#define SR_LOAD(name) SR_CHECK(set(name, GetDeviceProcAddr(device, "vk" #name), "vk" #name));
    SR_DEVICE_CALLS(SR_LOAD)
#undef SR_LOAD
#define SR_LOAD(name) name = reinterpret_cast<PFN_vk##name>(GetDeviceProcAddr(device, "vk" #name));
    SR_EXTENSION_CALLS(SR_LOAD)
#undef SR_LOAD
    return {};
}

} // namespace semrover
