/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A context on the application's device in C, and buffers and images of its own. */
#ifndef SEMROVER_TESTS_CAPI_MEMORY_H
#define SEMROVER_TESTS_CAPI_MEMORY_H

#include "tests/support/capi_vulkan.h"

static inline sr_context* adopt(const sr_vulkan_device* vulkan)
{
    sr_context_desc desc;
    sr_context* context = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = vulkan;
    CHECK_OK(NULL, sr_context_create(&desc, &context));
    return context;
}

static inline sr_context* adopt_host(const struct host* host)
{
    const sr_vulkan_device vulkan = lent(host);
    return adopt(&vulkan);
}

struct host_buffer {
    VkBuffer buffer;
    VkDeviceMemory memory;
    void* mapped; /* zeros at first */
};

struct host_image {
    VkImage image;
    VkDeviceMemory memory;
    uint32_t width, height;
};

/* of a type with these properties */
static inline VkDeviceMemory allocate(const struct host* host, const VkMemoryRequirements* needs,
                                      VkMemoryPropertyFlags wanted)
{
    VkPhysicalDeviceMemoryProperties types;
    VkMemoryAllocateInfo info = {0};
    VkDeviceMemory memory = VK_NULL_HANDLE;
    uint32_t type = 0;
    vkGetPhysicalDeviceMemoryProperties(host->physical, &types);
    while (type < types.memoryTypeCount &&
           !((needs->memoryTypeBits >> type & 1) && (types.memoryTypes[type].propertyFlags & wanted) == wanted))
        ++type;
    CHECK(type < types.memoryTypeCount);
    info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    info.allocationSize = needs->size;
    info.memoryTypeIndex = type;
    CHECK(vkAllocateMemory(host->device, &info, NULL, &memory) == VK_SUCCESS);
    return memory;
}

static inline struct host_buffer make_buffer(const struct host* host, size_t bytes)
{
    struct host_buffer made;
    VkBufferCreateInfo info = {0};
    VkMemoryRequirements needs;
    info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
    info.size = bytes;
    info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    CHECK(vkCreateBuffer(host->device, &info, NULL, &made.buffer) == VK_SUCCESS);
    vkGetBufferMemoryRequirements(host->device, made.buffer, &needs);
    made.memory = allocate(host, &needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    CHECK(vkBindBufferMemory(host->device, made.buffer, made.memory, 0) == VK_SUCCESS);
    CHECK(vkMapMemory(host->device, made.memory, 0, VK_WHOLE_SIZE, 0, &made.mapped) == VK_SUCCESS);
    memset(made.mapped, 0, bytes);
    return made;
}

static inline void destroy_buffer(const struct host* host, const struct host_buffer* buffer)
{
    vkDestroyBuffer(host->device, buffer->buffer, NULL);
    vkFreeMemory(host->device, buffer->memory, NULL);
}

static inline struct host_image make_image(const struct host* host, uint32_t width, uint32_t height, VkFormat format)
{
    struct host_image made;
    VkImageCreateInfo info = {0};
    VkMemoryRequirements needs;
    info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = format;
    info.extent.width = width;
    info.extent.height = height;
    info.extent.depth = 1;
    info.mipLevels = info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.tiling = VK_IMAGE_TILING_OPTIMAL;
    info.usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
    CHECK(vkCreateImage(host->device, &info, NULL, &made.image) == VK_SUCCESS);
    vkGetImageMemoryRequirements(host->device, made.image, &needs);
    made.memory = allocate(host, &needs, 0);
    CHECK(vkBindImageMemory(host->device, made.image, made.memory, 0) == VK_SUCCESS);
    made.width = width;
    made.height = height;
    return made;
}

static inline void destroy_image(const struct host* host, const struct host_image* image)
{
    vkDestroyImage(host->device, image->image, NULL);
    vkFreeMemory(host->device, image->memory, NULL);
}

struct host_commands {
    VkCommandPool pool;
    VkCommandBuffer commands;
};

static inline struct host_commands begin_commands(const struct host* host)
{
    struct host_commands made;
    VkCommandPoolCreateInfo pool = {0};
    VkCommandBufferAllocateInfo allocation = {0};
    VkCommandBufferBeginInfo begin = {0};
    pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    CHECK(vkCreateCommandPool(host->device, &pool, NULL, &made.pool) == VK_SUCCESS);
    allocation.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    allocation.commandPool = made.pool;
    allocation.commandBufferCount = 1;
    CHECK(vkAllocateCommandBuffers(host->device, &allocation, &made.commands) == VK_SUCCESS);
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    CHECK(vkBeginCommandBuffer(made.commands, &begin) == VK_SUCCESS);
    return made;
}

/* submits them and waits */
static inline void run_commands(const struct host* host, const struct host_commands* commands)
{
    VkSubmitInfo submit = {0};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands->commands;
    CHECK(vkQueueSubmit(host->queue, 1, &submit, VK_NULL_HANDLE) == VK_SUCCESS);
    CHECK(vkQueueWaitIdle(host->queue) == VK_SUCCESS);
}

/* copies an image in layout TRANSFER_SRC_OPTIMAL to the beginning of a buffer, and waits */
static inline void read_aspect(const struct host* host, const struct host_image* image, VkImageAspectFlags aspect,
                               const struct host_buffer* to)
{
    const struct host_commands commands = begin_commands(host);
    VkBufferImageCopy region = {0};
    region.imageSubresource.aspectMask = aspect;
    region.imageSubresource.layerCount = 1;
    region.imageExtent.width = image->width;
    region.imageExtent.height = image->height;
    region.imageExtent.depth = 1;
    vkCmdCopyImageToBuffer(commands.commands, image->image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to->buffer, 1,
                           &region);
    CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
    run_commands(host, &commands);
    vkDestroyCommandPool(host->device, commands.pool, NULL);
}
static inline void read_image(const struct host* host, const struct host_image* image, const struct host_buffer* to)
{
    read_aspect(host, image, VK_IMAGE_ASPECT_COLOR_BIT, to);
}

static inline VkSemaphore make_timeline(const struct host* host)
{
    VkSemaphoreTypeCreateInfo type = {0};
    VkSemaphoreCreateInfo info = {0};
    VkSemaphore made;
    type.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO;
    type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO;
    info.pNext = &type;
    CHECK(vkCreateSemaphore(host->device, &info, NULL, &made) == VK_SUCCESS);
    return made;
}

static inline void wait_value(const struct host* host, VkSemaphore semaphore, uint64_t value)
{
    VkSemaphoreWaitInfo info = {0};
    info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO;
    info.semaphoreCount = 1;
    info.pSemaphores = &semaphore;
    info.pValues = &value;
    CHECK(vkWaitSemaphores(host->device, &info, 60000000000u) == VK_SUCCESS);
}

#endif
