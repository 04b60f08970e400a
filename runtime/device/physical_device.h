// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"
#include "runtime/device/vulkan_calls.h"

namespace semrover {

inline constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

std::string api_version_text(uint32_t version); // "1.3.239"
Result<VkInstance> create_instance(bool validation, const VkAllocationCallbacks* allocation = nullptr);
// One that lives as long as the process and is never destroyed, so that drivers stay loaded: NVIDIA's finds no room in
// the static TLS block any more after a dozen times. From any thread.
Result<VkInstance> process_instance(bool validation);
Result<std::vector<VkPhysicalDevice>> physical_devices(const VulkanCalls& vk, VkInstance instance); // best first
DeviceSummary summarize(const VulkanCalls& vk, VkInstance instance, VkPhysicalDevice physical, uint32_t index);
bool has_extension(const VulkanCalls& vk, VkPhysicalDevice physical, const char* name);
bool has_pipeline_robustness(const VulkanCalls& vk, VkPhysicalDevice physical); // VK_EXT_pipeline_robustness
Result<uint32_t> compute_queue_family(const VulkanCalls& vk, VkPhysicalDevice physical);
bool has_timestamps(const VulkanCalls& vk, VkPhysicalDevice physical, uint32_t family);
bool is_compute_family(const VulkanCalls& vk, VkPhysicalDevice physical, uint32_t family);

} // namespace semrover
