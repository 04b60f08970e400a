// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/vulkan_calls.h"
#include "runtime/graph/limits.h"

// VK_KHR_cooperative_matrix, as headers before 1.3.255 (Debian 12) do not have it
#ifndef VK_KHR_cooperative_matrix
#define VK_KHR_cooperative_matrix 1
#define VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME "VK_KHR_cooperative_matrix"
constexpr VkStructureType VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_KHR =
    VkStructureType(1000506000);
constexpr VkStructureType VK_STRUCTURE_TYPE_COOPERATIVE_MATRIX_PROPERTIES_KHR = VkStructureType(1000506001);
enum VkComponentTypeKHR { VK_COMPONENT_TYPE_FLOAT16_KHR = 0, VK_COMPONENT_TYPE_FLOAT32_KHR = 1 };
enum VkScopeKHR { VK_SCOPE_SUBGROUP_KHR = 3 };
struct VkPhysicalDeviceCooperativeMatrixFeaturesKHR {
    VkStructureType sType;
    void* pNext;
    VkBool32 cooperativeMatrix;
    VkBool32 cooperativeMatrixRobustBufferAccess;
};
struct VkCooperativeMatrixPropertiesKHR {
    VkStructureType sType;
    void* pNext;
    uint32_t MSize, NSize, KSize;
    uint32_t AType, BType, CType, ResultType; // VkComponentTypeKHR
    VkBool32 saturatingAccumulation;
    uint32_t scope; // VkScopeKHR
};
using PFN_vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR = VkResult(VKAPI_PTR*)(VkPhysicalDevice, uint32_t*,
                                                                                   VkCooperativeMatrixPropertiesKHR*);
#endif

namespace semrover {

// The shape that .coopmat variants take on this device: 16 x 16 x 16 where there is one, else what their tiles can be
// cut into. m is 0 without the extension, the features beside it, or such a shape.
MatrixShape matrix_shape(const VulkanCalls& vk, VkInstance instance, VkPhysicalDevice physical);

// what a device must have enabled for them, beside vulkanMemoryModel, vulkanMemoryModelDeviceScope and shaderFloat16
class MatrixFeatures {
  public:
    MatrixFeatures();
    void* chain() { return &matrix_; } // of VkDeviceCreateInfo, or to be filled in; valid as long as this is
    bool all() const;

  private:
    VkPhysicalDeviceSubgroupSizeControlFeatures subgroups_;
    VkPhysicalDeviceCooperativeMatrixFeaturesKHR matrix_;
};

} // namespace semrover
