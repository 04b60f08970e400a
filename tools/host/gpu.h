/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The Vulkan device of a sample host, and a context of the library on it. Everything ends the program with a line where
 * it fails: these are samples. */
#ifndef HOST_GPU_H
#define HOST_GPU_H

#include <pthread.h>
#include <semrover_vulkan.h>
#include <vulkan/vulkan.h>

struct gpu {
    VkInstance instance;
    VkPhysicalDevice physical;
    VkDevice device;
    VkQueue queue;
    pthread_mutex_t queue_mutex; /* whoever uses the queue holds it: the library's worker thread does, too */
    uint32_t family;             /* draws, computes and presents */
    VkQueue work_queue;          /* for the library's work alone; NULL: this device has no other */
    uint32_t work_family, work_index;
    uint32_t matrices; /* 1: what the library needs for matrix units is enabled */
    VkSurfaceKHR surface;
    sr_context* context;
};

struct buffer {
    VkBuffer buffer;
    VkDeviceMemory memory;
    void* mapped; /* NULL: the host cannot see it */
};

struct image {
    VkImage image;
    VkDeviceMemory memory;
    VkImageView view;
};

void check(int fine, const char* what);                     /* else the program ends */
void check_sr(sr_status status, const sr_context* context); /* likewise, with the line of the library */

/* width x height pixels of four bytes, the top row first; swapped: blue comes first */
void write_ppm(const char* path, uint32_t width, uint32_t height, const unsigned char* rgba, int swapped);

/* extensions: of the instance. make_surface: gives gpu->surface, which the device must be able to present to, once
 * there is an instance; NULL: no window */
void gpu_create(struct gpu* gpu, const char* const* extensions, uint32_t count,
                void (*make_surface)(struct gpu* gpu, void* user), void* user);
void gpu_destroy(struct gpu* gpu);

/* a semaphore of whose values frame n reaches n; and until it has */
VkSemaphore gpu_timeline(const struct gpu* gpu);
void gpu_wait(const struct gpu* gpu, VkSemaphore timeline, uint64_t value);
/* frame `number` of a timeline; acquired and drawn (either may be NULL): semaphores of a swapchain's */
void gpu_submit(struct gpu* gpu, VkCommandBuffer commands, VkSemaphore timeline, uint64_t number, VkSemaphore acquired,
                VkSemaphore drawn);

/* a pool, and command buffers that can be recorded again */
void gpu_commands(const struct gpu* gpu, uint32_t count, VkCommandPool* pool, VkCommandBuffer* commands);

struct buffer gpu_buffer(const struct gpu* gpu, VkDeviceSize bytes, VkBufferUsageFlags usage, int mapped);
struct image gpu_image(const struct gpu* gpu, uint32_t width, uint32_t height, VkFormat format, VkImageUsageFlags usage,
                       VkImageAspectFlags aspect);
VkImageView gpu_view(const struct gpu* gpu, VkImage image, VkFormat format, VkImageAspectFlags aspect);
void gpu_free_buffer(const struct gpu* gpu, struct buffer* buffer);
void gpu_free_image(const struct gpu* gpu, struct image* image);

#endif
