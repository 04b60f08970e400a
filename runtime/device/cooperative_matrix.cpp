// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/cooperative_matrix.h"

#include "runtime/device/physical_device.h"

#include <algorithm>
#include <vector>

namespace semrover {

namespace {

constexpr uint32_t kPreferredSubgroup = 32; // AMD's and NVIDIA's matrix units work for 32 invocations

// of a device with both extensions: others leave what they do not know as it is
bool has_features(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    MatrixFeatures matrix;
    auto f12 = vk_struct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                                           matrix.chain());
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &f12);
    vk.GetPhysicalDeviceFeatures2(physical, &features);
    return matrix.all() && f12.vulkanMemoryModel && f12.vulkanMemoryModelDeviceScope && f12.shaderFloat16;
}

// 0: none that can be asked for
uint32_t subgroup_size(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    auto control = vk_struct<VkPhysicalDeviceSubgroupSizeControlProperties>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES);
    auto p11 = vk_struct<VkPhysicalDeviceVulkan11Properties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES,
                                                             &control);
    auto p = vk_struct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &p11);
    vk.GetPhysicalDeviceProperties2(physical, &p);
    if (!(control.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT))
        return 0;
    const uint32_t size = std::clamp(kPreferredSubgroup, control.minSubgroupSize, control.maxSubgroupSize);
    return 4 * size <= p.properties.limits.maxComputeWorkGroupInvocations && 4 <= control.maxComputeWorkgroupSubgroups
               ? size
               : 0;
}

// fp16 factors, sums of a type; can a tile be cut into them, and a step of K?
bool fits(const VkCooperativeMatrixPropertiesKHR& p, uint32_t sums)
{
    const auto one_of = [](uint32_t size, std::initializer_list<uint32_t> sizes) {
        return std::ranges::find(sizes, size) != sizes.end();
    };
    return p.AType == VK_COMPONENT_TYPE_FLOAT16_KHR && p.BType == VK_COMPONENT_TYPE_FLOAT16_KHR && p.CType == sums &&
           p.ResultType == sums && p.scope == VK_SCOPE_SUBGROUP_KHR && one_of(p.MSize, {8, 16}) &&
           one_of(p.NSize, {8, 16}) && one_of(p.KSize, {8, 16, 32});
}

} // namespace

MatrixShape matrix_shape(const VulkanCalls& vk, VkInstance instance, VkPhysicalDevice physical)
{
    const auto enumerate = reinterpret_cast<PFN_vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR>(
        vk.GetInstanceProcAddr(instance, "vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR"));
    if (!enumerate || !has_extension(vk, physical, VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME) ||
        !has_extension(vk, physical, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME) || !has_features(vk, physical))
        return {};
    uint32_t count = 0;
    if (enumerate(physical, &count, nullptr) != VK_SUCCESS)
        return {};
    std::vector<VkCooperativeMatrixPropertiesKHR> all(
        count, vk_struct<VkCooperativeMatrixPropertiesKHR>(VK_STRUCTURE_TYPE_COOPERATIVE_MATRIX_PROPERTIES_KHR));
    if (enumerate(physical, &count, all.data()) != VK_SUCCESS)
        return {};
    std::vector<VkCooperativeMatrixPropertiesKHR> half = all;
    std::erase_if(all, [](const auto& p) { return !fits(p, VK_COMPONENT_TYPE_FLOAT32_KHR); });
    std::erase_if(half, [](const auto& p) { return !fits(p, VK_COMPONENT_TYPE_FLOAT16_KHR); });
    const auto outputs = [](const auto& p) { return p.MSize * p.NSize * (p.KSize == 16 ? 2 : 1); };
    const auto best = std::ranges::max_element(all, {}, outputs);
    const uint32_t subgroup = subgroup_size(vk, physical);
    if (best == all.end() || !subgroup)
        return {};
    const bool half_sums = std::ranges::any_of(half, [&](const auto& p) {
        return p.MSize == best->MSize && p.NSize == best->NSize && p.KSize == best->KSize;
    });
    return {best->MSize, best->NSize, best->KSize, subgroup, half_sums};
}

MatrixFeatures::MatrixFeatures()
    : subgroups_(vk_struct<VkPhysicalDeviceSubgroupSizeControlFeatures>(
          VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES)),
      matrix_(vk_struct<VkPhysicalDeviceCooperativeMatrixFeaturesKHR>(
          VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_KHR, &subgroups_))
{
    subgroups_.subgroupSizeControl = VK_TRUE;
    subgroups_.computeFullSubgroups = VK_TRUE;
    matrix_.cooperativeMatrix = VK_TRUE;
}

bool MatrixFeatures::all() const
{
    return subgroups_.subgroupSizeControl && subgroups_.computeFullSubgroups && matrix_.cooperativeMatrix;
}

} // namespace semrover
