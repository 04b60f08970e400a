/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What tests in C share: checks, and a host with a Vulkan device, buffers and images of its own. */
#ifndef SEMROVER_TESTS_CAPI_VULKAN_H
#define SEMROVER_TESTS_CAPI_VULKAN_H

#include "engine/semrover.h"

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
static int says(const sr_context* context, const char* text)
{
    char message[512];
    const size_t length = sr_last_error(context, message, sizeof message);
    if (length < sizeof message && strstr(message, text) && !strchr(message, '\n'))
        return 1;
    fprintf(stderr, "expected \"%s\", found \"%s\"\n", text, message);
    return 0;
}

static void print_line(void* user, const char* line)
{
    fprintf((FILE*)user, "%s\n", line);
}

struct host {
    VkInstance instance;
    VkPhysicalDevice physical;
    VkDevice device;
    VkQueue queue; /* of family 0 */
};

static VkInstance make_instance(void)
{
    VkApplicationInfo app = {0};
    VkInstanceCreateInfo info = {0};
    VkInstance instance;
    app.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    app.apiVersion = VK_API_VERSION_1_2;
    info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    info.pApplicationInfo = &app;
    CHECK(vkCreateInstance(&info, NULL, &instance) == VK_SUCCESS);
    return instance;
}

static VkDevice make_device(VkPhysicalDevice physical)
{
    const float priority = 1;
    VkPhysicalDeviceVulkan12Features features = {0};
    VkDeviceQueueCreateInfo queue = {0};
    VkPhysicalDeviceFeatures robust = {0};
    VkDeviceCreateInfo info = {0};
    VkDevice device;
    robust.robustBufferAccess = VK_TRUE;
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
    CHECK(vkCreateDevice(physical, &info, NULL, &device) == VK_SUCCESS);
    return device;
}

static struct host make_host(void)
{
    struct host host;
    uint32_t count = 1;
    host.instance = make_instance();
    vkEnumeratePhysicalDevices(host.instance, &count, &host.physical);
    CHECK(count == 1);
    host.device = make_device(host.physical);
    vkGetDeviceQueue(host.device, 0, 0, &host.queue);
    return host;
}

static void destroy_host(const struct host* host)
{
    vkDestroyDevice(host->device, NULL);
    vkDestroyInstance(host->instance, NULL);
}

#endif
