/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What tests in C share: checks, and a host with a Vulkan device, buffers and images of its own. */
#ifndef SEMROVER_TESTS_CAPI_VULKAN_H
#define SEMROVER_TESTS_CAPI_VULKAN_H

#include "engine/semrover_vulkan.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vulkan.h>

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                                            \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* a call that must succeed; its line is shown where it does not */
#define CHECK_OK(context, call)                                                                                        \
    do {                                                                                                               \
        const sr_status check_status = (call);                                                                         \
        if (check_status != SR_OK) {                                                                                   \
            char check_line[512];                                                                                      \
            sr_last_error(context, check_line, sizeof check_line);                                                     \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, sr_status_name(check_status), check_line);          \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* the last error has this text in it */
static inline int says(const sr_context* context, const char* text)
{
    char message[512];
    const size_t length = sr_last_error(context, message, sizeof message);
    if (length < sizeof message && strstr(message, text) && !strchr(message, '\n'))
        return 1;
    fprintf(stderr, "expected \"%s\", found \"%s\"\n", text, message);
    return 0;
}

static inline void print_line(void* user, const char* line)
{
    fprintf((FILE*)user, "%s\n", line);
}

struct host {
    VkInstance instance;
    VkDebugUtilsMessengerEXT messenger; /* where SEMROVER_VALIDATION asks for it: a message ends the test */
    VkPhysicalDevice physical;
    VkDevice device;
    VkQueue queue; /* of family 0 */
};

static VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                                 VkDebugUtilsMessageTypeFlagsEXT type,
                                                 const VkDebugUtilsMessengerCallbackDataEXT* data, void* user)
{
    (void)severity;
    (void)type;
    (void)user;
    fprintf(stderr, "validation: %s\n", data->pMessage);
    exit(1);
}

static VkDebugUtilsMessengerEXT make_messenger(VkInstance instance)
{
    const PFN_vkCreateDebugUtilsMessengerEXT create =
        (PFN_vkCreateDebugUtilsMessengerEXT)vkGetInstanceProcAddr(instance, "vkCreateDebugUtilsMessengerEXT");
    VkDebugUtilsMessengerCreateInfoEXT info = {0};
    VkDebugUtilsMessengerEXT messenger;
    info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
    info.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    info.pfnUserCallback = on_message;
    CHECK(create(instance, &info, NULL, &messenger) == VK_SUCCESS);
    return messenger;
}

/* core and synchronization */
static VkInstance make_instance(int validation)
{
    const char* layer = "VK_LAYER_KHRONOS_validation";
    const char* extensions[2] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
    const VkValidationFeatureEnableEXT enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
    VkValidationFeaturesEXT features = {0};
    VkApplicationInfo app = {0};
    VkInstanceCreateInfo info = {0};
    VkInstance instance;
    app.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    app.apiVersion = VK_API_VERSION_1_2;
    features.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT;
    features.enabledValidationFeatureCount = 1;
    features.pEnabledValidationFeatures = &enables;
    info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    info.pApplicationInfo = &app;
    if (validation) {
        info.pNext = &features;
        info.enabledLayerCount = 1;
        info.ppEnabledLayerNames = &layer;
        info.enabledExtensionCount = 2;
        info.ppEnabledExtensionNames = extensions;
    }
    CHECK(vkCreateInstance(&info, NULL, &instance) == VK_SUCCESS);
    return instance;
}

/* extension: enabled; NULL: none. VK_EXT_pipeline_robustness takes the place of robustBufferAccess */
static VkDevice make_device(VkPhysicalDevice physical, const char* extension)
{
    const float priority = 1;
    VkPhysicalDeviceVulkan12Features features = {0};
    VkDeviceQueueCreateInfo queue = {0};
    VkPhysicalDeviceFeatures robust = {0};
    VkPhysicalDevicePipelineRobustnessFeaturesEXT of_pipelines = {0};
    VkDeviceCreateInfo info = {0};
    VkDevice device;
    const int by_pipelines = extension && !strcmp(extension, VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME);
    robust.robustBufferAccess = !by_pipelines;
    of_pipelines.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_ROBUSTNESS_FEATURES_EXT;
    of_pipelines.pipelineRobustness = VK_TRUE;
    features.pNext = by_pipelines ? &of_pipelines : NULL;
    features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    features.timelineSemaphore = VK_TRUE;
    queue.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    info.pNext = &features;
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.pEnabledFeatures = &robust;
    info.enabledExtensionCount = extension ? 1 : 0;
    info.ppEnabledExtensionNames = &extension;
    CHECK(vkCreateDevice(physical, &info, NULL, &device) == VK_SUCCESS);
    return device;
}

static struct host make_host_with(const char* extension)
{
    struct host host;
    uint32_t count = 1;
    const int validation = getenv("SEMROVER_VALIDATION") != NULL;
    host.instance = make_instance(validation);
    host.messenger = validation ? make_messenger(host.instance) : VK_NULL_HANDLE;
    vkEnumeratePhysicalDevices(host.instance, &count, &host.physical);
    CHECK(count == 1);
    host.device = make_device(host.physical, extension);
    vkGetDeviceQueue(host.device, 0, 0, &host.queue);
    return host;
}

static inline struct host make_host(void)
{
    return make_host_with(NULL);
}

static inline void destroy_host(const struct host* host)
{
    vkDestroyDevice(host->device, NULL);
    if (host->messenger)
        ((PFN_vkDestroyDebugUtilsMessengerEXT)vkGetInstanceProcAddr(host->instance, "vkDestroyDebugUtilsMessengerEXT"))(
            host->instance, host->messenger, NULL);
    vkDestroyInstance(host->instance, NULL);
}

/* the same for the library */
static inline sr_vulkan_device lent(const struct host* host)
{
    sr_vulkan_device vulkan;
    memset(&vulkan, 0, sizeof vulkan);
    vulkan.struct_size = sizeof vulkan;
    vulkan.instance = host->instance;
    vulkan.physical_device = host->physical;
    vulkan.device = host->device;
    vulkan.queue = host->queue;
    vulkan.robust_buffer_access = 1;
    return vulkan;
}

#endif
