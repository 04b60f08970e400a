// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/vulkan_calls.h"

#include <span>
#include <string>

namespace semrover {

// whether the device says what went wrong when it is lost (VK_EXT_device_fault)
bool tells_faults(const VulkanCalls& vk, VkPhysicalDevice physical);
// vk_error(), and for a lost device what its driver says: addresses of accesses, instruction pointers, vendor's codes
Error device_error(const VulkanCalls& vk, VkDevice device, VkResult result, const char* call);
// the same as text: "; DESCRIPTION; invalid write at 0x...; ..."
std::string fault_text(const VkDeviceFaultInfoEXT& info, std::span<const VkDeviceFaultAddressInfoEXT> addresses,
                       std::span<const VkDeviceFaultVendorInfoEXT> vendor);

} // namespace semrover
