// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <vulkan/vulkan.h>

namespace semrover {

const char* vk_result_name(VkResult result);
// call: its name, or the text of one through VulkanCalls
Error vk_error(VkResult result, const char* call);

// a structure of Vulkan's: its type, what follows it, and zeros
template <typename T>
T vk_struct(VkStructureType type, void* next = nullptr)
{
    T made{};
    made.sType = type;
    made.pNext = next;
    return made;
}

} // namespace semrover

#define SR_VK(call)                                                                                                    \
    do {                                                                                                               \
        if (const VkResult sr_vk_result = (call); sr_vk_result != VK_SUCCESS)                                          \
            return tl::make_unexpected(::semrover::vk_error(sr_vk_result, #call));                                     \
    } while (0)

// For calls that make `handle`, which is undefined after one that failed: destructors must not meet it.
#define SR_VK_MAKE(handle, call)                                                                                       \
    do {                                                                                                               \
        if (const VkResult sr_vk_result = (call); sr_vk_result != VK_SUCCESS) {                                        \
            (handle) = {};                                                                                             \
            return tl::make_unexpected(::semrover::vk_error(sr_vk_result, #call));                                     \
        }                                                                                                              \
    } while (0)
