// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/profile.h"
#include "runtime/device/vulkan_calls.h"

// What a driver says of a pipeline's code (VK_KHR_pipeline_executable_properties): registers, spills, shared memory,
// under the driver's own names.
namespace semrover {

bool has_pipeline_statistics(const VulkanCalls& vk, VkPhysicalDevice physical);

// of a pipeline that was made with VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR, on a device with the feature
Result<std::vector<Statistic>> statistics_of(const VulkanCalls& vk, VkDevice device, VkPipeline pipeline);

} // namespace semrover
