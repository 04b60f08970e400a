// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/pipeline_statistics.h"

#include "runtime/device/physical_device.h"

namespace semrover {

namespace {

double value_of(const VkPipelineExecutableStatisticKHR& s)
{
    switch (s.format) {
    case VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_BOOL32_KHR:
        return s.value.b32;
    case VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_INT64_KHR:
        return double(s.value.i64);
    case VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_UINT64_KHR:
        return double(s.value.u64);
    default:
        return s.value.f64;
    }
}

} // namespace

bool has_pipeline_statistics(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    if (!has_extension(vk, physical, VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME))
        return false;
    auto properties = vk_struct<VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR>(
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR);
    auto features = vk_struct<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &properties);
    vk.GetPhysicalDeviceFeatures2(physical, &features);
    return properties.pipelineExecutableInfo;
}

Result<std::vector<Statistic>> statistics_of(const VulkanCalls& vk, VkDevice device, VkPipeline pipeline)
{
    auto of_pipeline = vk_struct<VkPipelineInfoKHR>(VK_STRUCTURE_TYPE_PIPELINE_INFO_KHR);
    of_pipeline.pipeline = pipeline;
    uint32_t executables = 1; // a compute pipeline has one
    auto properties =
        vk_struct<VkPipelineExecutablePropertiesKHR>(VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_PROPERTIES_KHR);
    SR_VK(vk.GetPipelineExecutablePropertiesKHR(device, &of_pipeline, &executables, &properties));
    if (!executables)
        return std::vector<Statistic>{};
    auto of_executable = vk_struct<VkPipelineExecutableInfoKHR>(VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR);
    of_executable.pipeline = pipeline;
    uint32_t count = 0;
    SR_VK(vk.GetPipelineExecutableStatisticsKHR(device, &of_executable, &count, nullptr));
    std::vector<VkPipelineExecutableStatisticKHR> all(
        count, vk_struct<VkPipelineExecutableStatisticKHR>(VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR));
    SR_VK(vk.GetPipelineExecutableStatisticsKHR(device, &of_executable, &count, all.data()));
    std::vector<Statistic> statistics{{"Subgroup size", double(properties.subgroupSize)}};
    for (const VkPipelineExecutableStatisticKHR& s : all)
        statistics.push_back({s.name, value_of(s)});
    return statistics;
}

} // namespace semrover
