// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/exportable.h"

#include "runtime/device/physical_device.h"

#include <algorithm>

namespace semrover {

namespace {

VkExternalMemoryFeatureFlags buffer_features(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    auto asked = vk_struct<VkPhysicalDeviceExternalBufferInfo>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO);
    asked.usage = kExportedUsage;
    asked.handleType = VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT;
    auto found = vk_struct<VkExternalBufferProperties>(VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES);
    vk.GetPhysicalDeviceExternalBufferProperties(physical, &asked, &found);
    return found.externalMemoryProperties.externalMemoryFeatures;
}

bool exports_semaphores(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    auto asked =
        vk_struct<VkPhysicalDeviceExternalSemaphoreInfo>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_SEMAPHORE_INFO);
    asked.handleType = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
    auto found = vk_struct<VkExternalSemaphoreProperties>(VK_STRUCTURE_TYPE_EXTERNAL_SEMAPHORE_PROPERTIES);
    vk.GetPhysicalDeviceExternalSemaphoreProperties(physical, &asked, &found);
    return found.externalSemaphoreFeatures & VK_EXTERNAL_SEMAPHORE_FEATURE_EXPORTABLE_BIT;
}

} // namespace

Exportable exportable_of(const VulkanCalls& vk, VkPhysicalDevice physical)
{
    Exportable s;
    s.memory = has_extension(vk, physical, VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME) &&
               buffer_features(vk, physical) & VK_EXTERNAL_MEMORY_FEATURE_EXPORTABLE_BIT;
    s.semaphores =
        has_extension(vk, physical, VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME) && exports_semaphores(vk, physical);
    return s;
}

bool needs_dedicated_memory(const Device& device)
{
    return buffer_features(device.vk(), device.physical()) & VK_EXTERNAL_MEMORY_FEATURE_DEDICATED_ONLY_BIT;
}

DriverIds driver_ids(const Device& device)
{
    auto ids = vk_struct<VkPhysicalDeviceIDProperties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES);
    auto all = vk_struct<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &ids);
    device.vk().GetPhysicalDeviceProperties2(device.physical(), &all);
    DriverIds found;
    std::ranges::copy(ids.deviceUUID, found.device.begin());
    std::ranges::copy(ids.driverUUID, found.driver.begin());
    return found;
}

Result<std::unique_ptr<ExportedSemaphore>> ExportedSemaphore::create(Device& device)
{
    std::unique_ptr<ExportedSemaphore> s(new ExportedSemaphore(device));
    auto exported = vk_struct<VkExportSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO);
    exported.handleTypes = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
    auto info = vk_struct<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &exported);
    SR_VK_MAKE(s->semaphore_,
               device.vk().CreateSemaphore(device.handle(), &info, device.vk().allocator(), &s->semaphore_));
    return s;
}

ExportedSemaphore::~ExportedSemaphore()
{
    if (!semaphore_)
        return;
    (void)device_.wait(device_.last_ticket()); // a lost device is reported elsewhere
    device_.vk().DestroySemaphore(device_.handle(), semaphore_, device_.vk().allocator());
}

Result<int> ExportedSemaphore::descriptor() const
{
    auto info = vk_struct<VkSemaphoreGetFdInfoKHR>(VK_STRUCTURE_TYPE_SEMAPHORE_GET_FD_INFO_KHR);
    info.semaphore = semaphore_;
    info.handleType = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
    int descriptor = -1;
    SR_VK(device_.vk().GetSemaphoreFdKHR(device_.handle(), &info, &descriptor));
    return descriptor;
}

} // namespace semrover
