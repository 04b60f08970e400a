// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/debug_names.h"

namespace semrover {

void name_object(const VulkanCalls& vk, VkDevice device, VkObjectType type, uint64_t handle, const std::string& name)
{
    if (!vk.SetDebugUtilsObjectNameEXT)
        return;
    auto info = vk_struct<VkDebugUtilsObjectNameInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT);
    info.objectType = type;
    info.objectHandle = handle;
    info.pObjectName = name.c_str();
    (void)vk.SetDebugUtilsObjectNameEXT(device, &info); // a name that is not set is no error
}

DebugLabel::DebugLabel(const VulkanCalls& vk, VkCommandBuffer commands, const std::string& name)
    : vk_(vk), commands_(commands)
{
    if (!vk_.CmdBeginDebugUtilsLabelEXT || !vk_.CmdEndDebugUtilsLabelEXT)
        return;
    auto info = vk_struct<VkDebugUtilsLabelEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_LABEL_EXT);
    info.pLabelName = name.c_str();
    vk_.CmdBeginDebugUtilsLabelEXT(commands_, &info);
}

DebugLabel::~DebugLabel()
{
    if (vk_.CmdBeginDebugUtilsLabelEXT && vk_.CmdEndDebugUtilsLabelEXT)
        vk_.CmdEndDebugUtilsLabelEXT(commands_);
}

} // namespace semrover
