// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/vulkan.h"

namespace semrover {

const char* vk_result_name(VkResult r)
{
    switch (r) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
        return "VK_ERROR_OUT_OF_HOST_MEMORY";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
        return "VK_ERROR_OUT_OF_DEVICE_MEMORY";
    case VK_ERROR_INITIALIZATION_FAILED:
        return "VK_ERROR_INITIALIZATION_FAILED";
    case VK_ERROR_DEVICE_LOST:
        return "VK_ERROR_DEVICE_LOST";
    case VK_ERROR_MEMORY_MAP_FAILED:
        return "VK_ERROR_MEMORY_MAP_FAILED";
    case VK_ERROR_LAYER_NOT_PRESENT:
        return "VK_ERROR_LAYER_NOT_PRESENT";
    case VK_ERROR_EXTENSION_NOT_PRESENT:
        return "VK_ERROR_EXTENSION_NOT_PRESENT";
    case VK_ERROR_FEATURE_NOT_PRESENT:
        return "VK_ERROR_FEATURE_NOT_PRESENT";
    case VK_ERROR_INCOMPATIBLE_DRIVER:
        return "VK_ERROR_INCOMPATIBLE_DRIVER";
    case VK_ERROR_TOO_MANY_OBJECTS:
        return "VK_ERROR_TOO_MANY_OBJECTS";
    case VK_ERROR_OUT_OF_POOL_MEMORY:
        return "VK_ERROR_OUT_OF_POOL_MEMORY";
    case VK_ERROR_FRAGMENTED_POOL:
        return "VK_ERROR_FRAGMENTED_POOL";
    case VK_TIMEOUT:
        return "VK_TIMEOUT";
    default:
        return "VkResult";
    }
}

// "vkCreateBuffer" of "device_.vk().CreateBuffer(device_.handle(), ..": VulkanCalls' members have capitals
static std::string call_name(std::string_view call)
{
    for (size_t i = 1; i < call.size(); ++i)
        if (call[i - 1] == '.' && call[i] >= 'A' && call[i] <= 'Z')
            return fmt::format("vk{}", call.substr(i, call.find('(', i) - i));
    return std::string(call);
}

Error vk_error(VkResult result, const char* call)
{
    const ErrorCode code = result == VK_ERROR_DEVICE_LOST            ? ErrorCode::device_lost
                           : result == VK_ERROR_OUT_OF_DEVICE_MEMORY ? ErrorCode::out_of_memory
                           : result == VK_ERROR_OUT_OF_HOST_MEMORY   ? ErrorCode::out_of_memory
                           : result == VK_ERROR_OUT_OF_POOL_MEMORY   ? ErrorCode::out_of_memory
                           : result == VK_ERROR_FRAGMENTED_POOL      ? ErrorCode::out_of_memory
                           : result == VK_ERROR_TOO_MANY_OBJECTS     ? ErrorCode::out_of_memory
                           : result == VK_ERROR_MEMORY_MAP_FAILED    ? ErrorCode::out_of_memory
                                                                     : ErrorCode::no_device;
    return {code, fmt::format("{} ({}) from {}", vk_result_name(result), int(result), call_name(call))};
}

} // namespace semrover
