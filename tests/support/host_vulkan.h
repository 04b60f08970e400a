// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/cooperative_matrix.h"
#include "runtime/device/vulkan.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>
#include <vulkan/vulkan.h>

namespace semrover {

// a program that has Vulkan already, and lends its device: plain calls; with SEMROVER_VALIDATION its instance has the
// layer too, and messages are counted
class HostVulkan {
  public:
    // matrices: enables what matrix units need, if the device has that
    explicit HostVulkan(bool matrices = false)
    {
        make_instance();
        uint32_t count = 1;
        vkEnumeratePhysicalDevices(instance, &count, &physical);
        has_matrices = matrices && has_extension(VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME);
        make_device();
    }
    HostVulkan(const HostVulkan&) = delete;
    HostVulkan& operator=(const HostVulkan&) = delete;
    ~HostVulkan()
    {
        vkDestroyDevice(device, nullptr);
        if (messenger_)
            reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
                vkGetInstanceProcAddr(instance, "vkDestroyDebugUtilsMessengerEXT"))(instance, messenger_, nullptr);
        vkDestroyInstance(instance, nullptr);
    }

    VkInstance instance = VK_NULL_HANDLE;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    VkDevice device = VK_NULL_HANDLE;
    VkQueue queue = VK_NULL_HANDLE;
    bool has_matrices = false; // they are enabled
    int messages = 0;

  private:
    bool has_extension(const char* name) const
    {
        uint32_t count = 0;
        vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, nullptr);
        std::vector<VkExtensionProperties> all(count);
        vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, all.data());
        return std::ranges::any_of(all, [&](const auto& e) { return !std::strcmp(e.extensionName, name); });
    }
    void make_device()
    {
        const float priority = 1;
        auto wanted = vk_struct<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
        wanted.queueCount = 1;
        wanted.pQueuePriorities = &priority;
        auto features =
            vk_struct<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
        features.timelineSemaphore = VK_TRUE;
        MatrixFeatures matrix;
        const char* extensions[] = {VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME,
                                    VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME};
        if (has_matrices) {
            features.pNext = matrix.chain();
            features.shaderFloat16 = features.vulkanMemoryModel = features.vulkanMemoryModelDeviceScope = VK_TRUE;
        }
        auto info = vk_struct<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &features);
        info.queueCreateInfoCount = 1;
        info.pQueueCreateInfos = &wanted;
        info.enabledExtensionCount = has_matrices ? 2 : 0;
        info.ppEnabledExtensionNames = extensions;
        VkPhysicalDeviceFeatures robust{};
        robust.robustBufferAccess = VK_TRUE;
        info.pEnabledFeatures = &robust;
        if (vkCreateDevice(physical, &info, nullptr, &device) != VK_SUCCESS)
            std::abort();
        vkGetDeviceQueue(device, 0, 0, &queue);
    }
    static VKAPI_ATTR VkBool32 VKAPI_CALL count(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                                const VkDebugUtilsMessengerCallbackDataEXT* data, void* host)
    {
        std::fprintf(stderr, "validation: %s\n", data->pMessage);
        ++static_cast<HostVulkan*>(host)->messages;
        return VK_FALSE;
    }
    void make_instance()
    {
        const bool validation = std::getenv("SEMROVER_VALIDATION");
        const char *layer = "VK_LAYER_KHRONOS_validation", *extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
        auto app = vk_struct<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
        app.apiVersion = VK_API_VERSION_1_2;
        auto info = vk_struct<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
        info.pApplicationInfo = &app;
        info.enabledLayerCount = info.enabledExtensionCount = validation;
        info.ppEnabledLayerNames = &layer;
        info.ppEnabledExtensionNames = &extension;
        if (vkCreateInstance(&info, nullptr, &instance) != VK_SUCCESS)
            std::abort();
        if (!validation)
            return;
        auto messages_to =
            vk_struct<VkDebugUtilsMessengerCreateInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
        messages_to.messageSeverity =
            VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
        messages_to.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
        messages_to.pfnUserCallback = count;
        messages_to.pUserData = this;
        reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(vkGetInstanceProcAddr(
            instance, "vkCreateDebugUtilsMessengerEXT"))(instance, &messages_to, nullptr, &messenger_);
    }

    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
};

} // namespace semrover
