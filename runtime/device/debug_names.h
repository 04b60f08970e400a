// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/vulkan_calls.h"

#include <string>

// Names that RenderDoc, Nsight and validation layers show (VK_EXT_debug_utils). Nothing happens where the instance does
// not have the extension.
namespace semrover {

void name_object(const VulkanCalls& vk, VkDevice device, VkObjectType type, uint64_t handle, const std::string& name);

// commands that are recorded while it lives have this label
class DebugLabel {
  public:
    DebugLabel(const VulkanCalls& vk, VkCommandBuffer commands, const std::string& name);
    ~DebugLabel();
    DebugLabel(const DebugLabel&) = delete;
    DebugLabel& operator=(const DebugLabel&) = delete;

  private:
    const VulkanCalls& vk_;
    VkCommandBuffer commands_;
};

} // namespace semrover
