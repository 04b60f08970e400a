// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <vulkan/vulkan.h>

namespace semrover {

const char* vk_result_name(VkResult result);
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
