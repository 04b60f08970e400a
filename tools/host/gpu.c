/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0 */
#include "gpu.h"

#include "matrices.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_DEVICES = 16, MOST_FAMILIES = 16 };

void check(int fine, const char* what)
{
    if (fine)
        return;
    fprintf(stderr, "%s failed\n", what);
    exit(1);
}

void check_sr(sr_status status, const sr_context* context)
{
    char line[512];
    if (status == SR_OK)
        return;
    sr_last_error(context, line, sizeof line);
    fprintf(stderr, "%s: %s\n", sr_status_name(status), line);
    exit((int)status);
}

void write_ppm(const char* path, uint32_t width, uint32_t height, const unsigned char* rgba, int swapped)
{
    FILE* file = fopen(path, "wb");
    size_t i;
    int c;
    check(file != NULL, path);
    fprintf(file, "P6 %u %u 255\n", (unsigned)width, (unsigned)height);
    for (i = 0; i < (size_t)width * height; ++i)
        for (c = 0; c < 3; ++c)
            fputc(rgba[4 * i + (swapped ? 2 - c : c)], file);
    check(fclose(file) == 0, path);
}

/* a queue family that does all that a frame needs; 0 where there is none */
static int find_family(struct gpu* gpu)
{
    VkQueueFamilyProperties families[MOST_FAMILIES];
    const VkQueueFlags wanted = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    uint32_t count = MOST_FAMILIES, i;
    vkGetPhysicalDeviceQueueFamilyProperties(gpu->physical, &count, families);
    for (i = 0; i < count; ++i) {
        VkBool32 presents = VK_TRUE;
        if (gpu->surface)
            vkGetPhysicalDeviceSurfaceSupportKHR(gpu->physical, i, gpu->surface, &presents);
        if ((families[i].queueFlags & wanted) == wanted && presents) {
            gpu->family = i;
            return 1;
        }
    }
    return 0;
}

/* a queue beside it that computes: of another family, which a GPU runs beside ours, or a second one of ours */
static void find_work_queue(struct gpu* gpu)
{
    VkQueueFamilyProperties families[MOST_FAMILIES];
    uint32_t count = MOST_FAMILIES, i;
    vkGetPhysicalDeviceQueueFamilyProperties(gpu->physical, &count, families);
    gpu->work_family = gpu->family;
    gpu->work_index = families[gpu->family].queueCount > 1;
    for (i = 0; i < count; ++i)
        if (i != gpu->family && (families[i].queueFlags & VK_QUEUE_COMPUTE_BIT)) {
            gpu->work_family = i;
            gpu->work_index = 0;
            return;
        }
}

static void pick_device(struct gpu* gpu)
{
    VkPhysicalDevice devices[MOST_DEVICES];
    uint32_t count = MOST_DEVICES, i;
    const VkResult listed = vkEnumeratePhysicalDevices(gpu->instance, &count, devices);
    check(listed == VK_SUCCESS || listed == VK_INCOMPLETE, "vkEnumeratePhysicalDevices");
    for (i = 0; i < count; ++i) {
        gpu->physical = devices[i];
        if (find_family(gpu))
            return;
    }
    check(0, "looking for a device that draws and computes");
}

/* with what the library needs enabled: timelineSemaphore and robustBufferAccess, and what matrix units need */
static void make_device(struct gpu* gpu)
{
    const char* extensions[1 + MATRIX_EXTENSIONS] = {"VK_KHR_swapchain"};
    const float priorities[2] = {1, 0.5f};
    const int other_family = gpu->work_family != gpu->family;
    uint32_t count = gpu->surface ? 1 : 0, i;
    struct matrices matrices;
    VkPhysicalDeviceVulkan12Features features = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                                 .timelineSemaphore = VK_TRUE};
    const VkPhysicalDeviceFeatures robust = {.robustBufferAccess = VK_TRUE};
    const VkDeviceQueueCreateInfo queues[2] = {{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                                .queueFamilyIndex = gpu->family,
                                                .queueCount = 1 + gpu->work_index,
                                                .pQueuePriorities = priorities},
                                               {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                                .queueFamilyIndex = gpu->work_family,
                                                .queueCount = 1,
                                                .pQueuePriorities = priorities + 1}};
    VkDeviceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                               .pNext = &features,
                               .queueCreateInfoCount = other_family ? 2 : 1,
                               .pQueueCreateInfos = queues,
                               .ppEnabledExtensionNames = extensions,
                               .pEnabledFeatures = &robust};
    matrices_ask(&matrices, gpu->physical, &features);
    gpu->matrices = matrices.enabled;
    features.pNext = matrices.chain;
    for (i = 0; matrices.enabled && i < MATRIX_EXTENSIONS; ++i)
        extensions[count++] = matrices.extensions[i];
    info.enabledExtensionCount = count;
    check(vkCreateDevice(gpu->physical, &info, NULL, &gpu->device) == VK_SUCCESS, "vkCreateDevice");
    vkGetDeviceQueue(gpu->device, gpu->family, 0, &gpu->queue);
    if (other_family || gpu->work_index)
        vkGetDeviceQueue(gpu->device, gpu->work_family, gpu->work_index, &gpu->work_queue);
}

static void lock_queue(void* user)
{
    pthread_mutex_lock(&((struct gpu*)user)->queue_mutex);
}

static void unlock_queue(void* user)
{
    pthread_mutex_unlock(&((struct gpu*)user)->queue_mutex);
}

/* the library on this device: it submits to our queue, from the thread that draws and from its worker */
static void make_context(struct gpu* gpu)
{
    const sr_vulkan_device vulkan = {.struct_size = sizeof vulkan,
                                     .queue_family = gpu->family,
                                     .instance = gpu->instance,
                                     .physical_device = gpu->physical,
                                     .device = gpu->device,
                                     .queue = gpu->queue,
                                     .user = gpu,
                                     .lock_queue = lock_queue,
                                     .unlock_queue = unlock_queue,
                                     .work_queue = gpu->work_queue,
                                     .work_queue_family = gpu->work_family,
                                     .shader_float16 = gpu->matrices,
                                     .robust_buffer_access = 1,
                                     .cooperative_matrix = gpu->matrices};
    const sr_context_desc desc = {.struct_size = sizeof desc, .vulkan = &vulkan};
    check_sr(sr_context_create(&desc, &gpu->context), NULL);
}

void gpu_create(struct gpu* gpu, const char* const* extensions, uint32_t count,
                void (*make_surface)(struct gpu* gpu, void* user), void* user)
{
    const VkApplicationInfo app = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_2};
    const VkInstanceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                       .pApplicationInfo = &app,
                                       .enabledExtensionCount = count,
                                       .ppEnabledExtensionNames = extensions};
    memset(gpu, 0, sizeof *gpu);
    check(vkCreateInstance(&info, NULL, &gpu->instance) == VK_SUCCESS, "vkCreateInstance");
    if (make_surface)
        make_surface(gpu, user);
    pick_device(gpu);
    find_work_queue(gpu);
    make_device(gpu);
    check(!pthread_mutex_init(&gpu->queue_mutex, NULL), "making a mutex");
    make_context(gpu);
}

void gpu_destroy(struct gpu* gpu)
{
    sr_context_destroy(gpu->context);
    vkDestroyDevice(gpu->device, NULL);
    if (gpu->surface)
        vkDestroySurfaceKHR(gpu->instance, gpu->surface, NULL);
    vkDestroyInstance(gpu->instance, NULL);
    pthread_mutex_destroy(&gpu->queue_mutex);
}

VkSemaphore gpu_timeline(const struct gpu* gpu)
{
    const VkSemaphoreTypeCreateInfo type = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO,
                                            .semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE};
    const VkSemaphoreCreateInfo info = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, .pNext = &type};
    VkSemaphore made;
    check(vkCreateSemaphore(gpu->device, &info, NULL, &made) == VK_SUCCESS, "vkCreateSemaphore");
    return made;
}

void gpu_wait(const struct gpu* gpu, VkSemaphore timeline, uint64_t value)
{
    const VkSemaphoreWaitInfo info = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO,
                                      .semaphoreCount = 1,
                                      .pSemaphores = &timeline,
                                      .pValues = &value};
    check(vkWaitSemaphores(gpu->device, &info, UINT64_MAX) == VK_SUCCESS, "vkWaitSemaphores");
}

void gpu_submit(struct gpu* gpu, VkCommandBuffer commands, VkSemaphore timeline, uint64_t number, VkSemaphore acquired,
                VkSemaphore drawn)
{
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    const uint64_t nothing = 0, values[2] = {number, 0};
    const VkSemaphore signals[2] = {timeline, drawn};
    const VkTimelineSemaphoreSubmitInfo numbers = {.sType = VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO,
                                                   .waitSemaphoreValueCount = acquired ? 1 : 0,
                                                   .pWaitSemaphoreValues = &nothing,
                                                   .signalSemaphoreValueCount = drawn ? 2 : 1,
                                                   .pSignalSemaphoreValues = values};
    const VkSubmitInfo info = {.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
                               .pNext = &numbers,
                               .waitSemaphoreCount = numbers.waitSemaphoreValueCount,
                               .pWaitSemaphores = &acquired,
                               .pWaitDstStageMask = &stage,
                               .commandBufferCount = 1,
                               .pCommandBuffers = &commands,
                               .signalSemaphoreCount = numbers.signalSemaphoreValueCount,
                               .pSignalSemaphores = signals};
    pthread_mutex_lock(&gpu->queue_mutex);
    check(vkQueueSubmit(gpu->queue, 1, &info, VK_NULL_HANDLE) == VK_SUCCESS, "vkQueueSubmit");
    pthread_mutex_unlock(&gpu->queue_mutex);
}

void gpu_commands(const struct gpu* gpu, uint32_t count, VkCommandPool* pool, VkCommandBuffer* commands)
{
    const VkCommandPoolCreateInfo info = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                          .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
                                          .queueFamilyIndex = gpu->family};
    VkCommandBufferAllocateInfo wanted = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                          .commandBufferCount = count};
    check(vkCreateCommandPool(gpu->device, &info, NULL, pool) == VK_SUCCESS, "vkCreateCommandPool");
    wanted.commandPool = *pool;
    check(vkAllocateCommandBuffers(gpu->device, &wanted, commands) == VK_SUCCESS, "vkAllocateCommandBuffers");
}

static VkDeviceMemory allocate(const struct gpu* gpu, const VkMemoryRequirements* needs, VkMemoryPropertyFlags wanted)
{
    VkPhysicalDeviceMemoryProperties types;
    VkMemoryAllocateInfo info = {.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, .allocationSize = needs->size};
    VkDeviceMemory memory = VK_NULL_HANDLE;
    vkGetPhysicalDeviceMemoryProperties(gpu->physical, &types);
    while (info.memoryTypeIndex < types.memoryTypeCount &&
           !((needs->memoryTypeBits >> info.memoryTypeIndex & 1) &&
             (types.memoryTypes[info.memoryTypeIndex].propertyFlags & wanted) == wanted))
        ++info.memoryTypeIndex;
    check(info.memoryTypeIndex < types.memoryTypeCount, "looking for a type of memory");
    check(vkAllocateMemory(gpu->device, &info, NULL, &memory) == VK_SUCCESS, "vkAllocateMemory");
    return memory;
}

struct buffer gpu_buffer(const struct gpu* gpu, VkDeviceSize bytes, VkBufferUsageFlags usage, int mapped)
{
    const VkBufferCreateInfo info = {.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = bytes, .usage = usage};
    const VkMemoryPropertyFlags seen = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    VkMemoryRequirements needs;
    struct buffer made = {VK_NULL_HANDLE, VK_NULL_HANDLE, NULL};
    check(vkCreateBuffer(gpu->device, &info, NULL, &made.buffer) == VK_SUCCESS, "vkCreateBuffer");
    vkGetBufferMemoryRequirements(gpu->device, made.buffer, &needs);
    made.memory = allocate(gpu, &needs, mapped ? seen : 0);
    check(vkBindBufferMemory(gpu->device, made.buffer, made.memory, 0) == VK_SUCCESS, "vkBindBufferMemory");
    if (mapped)
        check(vkMapMemory(gpu->device, made.memory, 0, VK_WHOLE_SIZE, 0, &made.mapped) == VK_SUCCESS, "vkMapMemory");
    return made;
}

VkImageView gpu_view(const struct gpu* gpu, VkImage image, VkFormat format, VkImageAspectFlags aspect)
{
    const VkImageViewCreateInfo info = {.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO,
                                        .image = image,
                                        .viewType = VK_IMAGE_VIEW_TYPE_2D,
                                        .format = format,
                                        .subresourceRange = {aspect, 0, 1, 0, 1}};
    VkImageView view;
    check(vkCreateImageView(gpu->device, &info, NULL, &view) == VK_SUCCESS, "vkCreateImageView");
    return view;
}

struct image gpu_image(const struct gpu* gpu, uint32_t width, uint32_t height, VkFormat format, VkImageUsageFlags usage,
                       VkImageAspectFlags aspect)
{
    const VkImageCreateInfo info = {.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO,
                                    .imageType = VK_IMAGE_TYPE_2D,
                                    .format = format,
                                    .extent = {width, height, 1},
                                    .mipLevels = 1,
                                    .arrayLayers = 1,
                                    .samples = VK_SAMPLE_COUNT_1_BIT,
                                    .usage = usage};
    VkMemoryRequirements needs;
    struct image made;
    check(vkCreateImage(gpu->device, &info, NULL, &made.image) == VK_SUCCESS, "vkCreateImage");
    vkGetImageMemoryRequirements(gpu->device, made.image, &needs);
    made.memory = allocate(gpu, &needs, 0);
    check(vkBindImageMemory(gpu->device, made.image, made.memory, 0) == VK_SUCCESS, "vkBindImageMemory");
    made.view = gpu_view(gpu, made.image, format, aspect);
    return made;
}

void gpu_free_buffer(const struct gpu* gpu, struct buffer* buffer)
{
    vkDestroyBuffer(gpu->device, buffer->buffer, NULL);
    vkFreeMemory(gpu->device, buffer->memory, NULL);
}

void gpu_free_image(const struct gpu* gpu, struct image* image)
{
    vkDestroyImageView(gpu->device, image->view, NULL);
    vkDestroyImage(gpu->device, image->image, NULL);
    vkFreeMemory(gpu->device, image->memory, NULL);
}
