/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host with a window: flies down a street that grows ahead of it. Two frames are on their way at a time, and another
 * thread generates. At its end it says how long the library's calls kept the thread that draws.
 *
 *     vulkan_host MODEL [FRAMES SCREENSHOT.ppm]     with FRAMES it ends by itself, and writes what it saw last
 *
 * MODEL -: without the library's splats, to compare.
 *
 * Keys: left and right turn, up and down change the speed, space puts a block onto the road ahead, escape ends. */
#include "scene.h"
#include "street.h"

#define GLFW_INCLUDE_VULKAN
#include <GLFW/glfw3.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct window {
    GLFWwindow* glfw;
    struct gpu gpu;
    VkSwapchainKHR swapchain;
    uint32_t pictures;
    VkImage images[MOST_PICTURES];
    VkImageView views[MOST_PICTURES];
    VkSemaphore drawn[MOST_PICTURES]; /* of the picture: may be shown */
    VkSemaphore timeline;             /* frame n reaches n */
    uint64_t number;                  /* of the last frame */
    VkSemaphore acquired[FRAMES_ON_THEIR_WAY];
    VkCommandPool pool;
    VkCommandBuffer commands[FRAMES_ON_THEIR_WAY];
    struct scene scene;
    struct buffer pixels; /* of the picture, for the screenshot */
};

struct drive {
    double position[3], yaw, speed; /* metres, radians, metres a second */
    int space;                      /* it was down in the frame before */
};

static void make_surface(struct gpu* gpu, void* user)
{
    const struct window* w = user;
    check(glfwCreateWindowSurface(gpu->instance, w->glfw, NULL, &gpu->surface) == VK_SUCCESS, "making a surface");
}

static VkSemaphore make_semaphore(const struct gpu* gpu)
{
    const VkSemaphoreCreateInfo info = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO};
    VkSemaphore made;
    check(vkCreateSemaphore(gpu->device, &info, NULL, &made) == VK_SUCCESS, "vkCreateSemaphore");
    return made;
}

/* eight bits a channel that are shown as they are: splats are sRGB already */
static VkSurfaceFormatKHR pick_format(const struct gpu* gpu)
{
    VkSurfaceFormatKHR formats[32];
    uint32_t count = 32, i;
    vkGetPhysicalDeviceSurfaceFormatsKHR(gpu->physical, gpu->surface, &count, formats);
    for (i = 0; i < count; ++i)
        if (formats[i].format == VK_FORMAT_B8G8R8A8_UNORM || formats[i].format == VK_FORMAT_R8G8B8A8_UNORM)
            return formats[i];
    check(0, "looking for a format of the window");
    return formats[0];
}

static void make_swapchain(struct window* w)
{
    const struct gpu* gpu = &w->gpu;
    const VkSurfaceFormatKHR format = pick_format(gpu);
    VkSurfaceCapabilitiesKHR can;
    VkSwapchainCreateInfoKHR info = {.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR,
                                     .surface = gpu->surface,
                                     .imageFormat = format.format,
                                     .imageColorSpace = format.colorSpace,
                                     .imageArrayLayers = 1,
                                     .imageUsage =
                                         VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT,
                                     .compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR,
                                     .presentMode = VK_PRESENT_MODE_FIFO_KHR,
                                     .clipped = VK_TRUE};
    int width = 0, height = 0;
    uint32_t i;
    glfwGetFramebufferSize(w->glfw, &width, &height);
    vkGetPhysicalDeviceSurfaceCapabilitiesKHR(gpu->physical, gpu->surface, &can);
    if (can.currentExtent.width != UINT32_MAX) {
        width = (int)can.currentExtent.width;
        height = (int)can.currentExtent.height;
    }
    info.minImageCount = can.minImageCount;
    info.imageExtent.width = (uint32_t)width;
    info.imageExtent.height = (uint32_t)height;
    info.preTransform = can.currentTransform;
    check(vkCreateSwapchainKHR(gpu->device, &info, NULL, &w->swapchain) == VK_SUCCESS, "vkCreateSwapchainKHR");
    w->pictures = MOST_PICTURES;
    check(vkGetSwapchainImagesKHR(gpu->device, w->swapchain, &w->pictures, w->images) == VK_SUCCESS,
          "vkGetSwapchainImagesKHR");
    for (i = 0; i < w->pictures; ++i) {
        w->views[i] = gpu_view(gpu, w->images[i], format.format, VK_IMAGE_ASPECT_COLOR_BIT);
        w->drawn[i] = make_semaphore(gpu);
    }
    scene_create(&w->scene, gpu, w->views, w->pictures, format.format, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR,
                 info.imageExtent.width, info.imageExtent.height);
    w->pixels = gpu_buffer(gpu, (VkDeviceSize)width * height * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT, 1);
}

static void free_swapchain(struct window* w)
{
    const VkDevice device = w->gpu.device;
    uint32_t i;
    pthread_mutex_lock(&w->gpu.queue_mutex); /* the worker may submit */
    vkQueueWaitIdle(w->gpu.queue);
    pthread_mutex_unlock(&w->gpu.queue_mutex);
    gpu_free_buffer(&w->gpu, &w->pixels);
    scene_destroy(&w->scene);
    for (i = 0; i < w->pictures; ++i) {
        vkDestroyImageView(device, w->views[i], NULL);
        vkDestroySemaphore(device, w->drawn[i], NULL);
    }
    vkDestroySwapchainKHR(device, w->swapchain, NULL);
}

static void open_window(struct window* w)
{
    const char* const* extensions;
    uint32_t count = 0, i;
    check(glfwInit(), "glfwInit");
    glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
    w->glfw = glfwCreateWindow(480, 300, "semrover", NULL, NULL);
    check(w->glfw != NULL, "opening a window");
    extensions = glfwGetRequiredInstanceExtensions(&count);
    gpu_create(&w->gpu, extensions, count, make_surface, w);
    gpu_commands(&w->gpu, FRAMES_ON_THEIR_WAY, &w->pool, w->commands);
    w->timeline = gpu_timeline(&w->gpu);
    for (i = 0; i < FRAMES_ON_THEIR_WAY; ++i)
        w->acquired[i] = make_semaphore(&w->gpu);
    make_swapchain(w);
}

static void close_window(struct window* w)
{
    uint32_t i;
    free_swapchain(w);
    for (i = 0; i < FRAMES_ON_THEIR_WAY; ++i)
        vkDestroySemaphore(w->gpu.device, w->acquired[i], NULL);
    vkDestroySemaphore(w->gpu.device, w->timeline, NULL);
    vkDestroyCommandPool(w->gpu.device, w->pool, NULL);
    gpu_destroy(&w->gpu);
    glfwDestroyWindow(w->glfw);
    glfwTerminate();
}

static void turn(VkCommandBuffer commands, VkImage image, VkImageLayout from, VkImageLayout to)
{
    const VkImageMemoryBarrier barrier = {.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER,
                                          .srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT,
                                          .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT,
                                          .oldLayout = from,
                                          .newLayout = to,
                                          .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                          .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                          .image = image,
                                          .subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1}};
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0, NULL,
                         0, NULL, 1, &barrier);
}

/* a copy of the picture for the screenshot */
static void copy_picture(const struct window* w, uint32_t picture, VkCommandBuffer commands)
{
    const VkImage image = w->images[picture];
    turn(commands, image, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    scene_copy(&w->scene, image, &w->pixels, commands);
    turn(commands, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR);
}

/* Draws and shows one frame, when the one before the last is finished. 0: the window has another size now */
static int show(struct window* w, sr_world* world, const sr_draw_desc* draw, int copied)
{
    const VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    const uint64_t number = w->number + 1;
    const VkCommandBuffer commands = w->commands[number % FRAMES_ON_THEIR_WAY];
    const VkSemaphore acquired = w->acquired[number % FRAMES_ON_THEIR_WAY];
    const sr_semaphore done = {w->timeline, number};
    const double since = clock_now();
    VkPresentInfoKHR present = {.sType = VK_STRUCTURE_TYPE_PRESENT_INFO_KHR,
                                .waitSemaphoreCount = 1,
                                .swapchainCount = 1,
                                .pSwapchains = &w->swapchain};
    uint32_t picture = 0;
    VkResult result;
    if (number > FRAMES_ON_THEIR_WAY)
        gpu_wait(&w->gpu, w->timeline, number - FRAMES_ON_THEIR_WAY);
    result = vkAcquireNextImageKHR(w->gpu.device, w->swapchain, UINT64_MAX, acquired, VK_NULL_HANDLE, &picture);
    calls_add(&scene_calls[CALL_FRAME_BEFORE], since);
    if (result == VK_ERROR_OUT_OF_DATE_KHR)
        return 0;
    check(result == VK_SUCCESS || result == VK_SUBOPTIMAL_KHR, "vkAcquireNextImageKHR");
    w->number = number;
    check(vkBeginCommandBuffer(commands, &begin) == VK_SUCCESS, "vkBeginCommandBuffer");
    scene_record(&w->scene, world, draw, &done, picture, commands);
    if (copied)
        copy_picture(w, picture, commands);
    check(vkEndCommandBuffer(commands) == VK_SUCCESS, "vkEndCommandBuffer");
    gpu_submit(&w->gpu, commands, w->timeline, number, acquired, w->drawn[picture]);
    present.pWaitSemaphores = &w->drawn[picture];
    present.pImageIndices = &picture;
    pthread_mutex_lock(&w->gpu.queue_mutex);
    result = vkQueuePresentKHR(w->gpu.queue, &present);
    pthread_mutex_unlock(&w->gpu.queue_mutex);
    return result == VK_SUCCESS;
}

/* a block of three voxels where the camera looks, four metres ahead */
static void put_block(struct gpu* gpu, sr_world* world, const struct drive* d)
{
    sr_cell cells[3];
    const double since = clock_now();
    int32_t k;
    for (k = 0; k < 3; ++k) {
        cells[k].i = (int32_t)floor((d->position[0] + 4 * cos(d->yaw)) / VOXEL);
        cells[k].j = (int32_t)floor((d->position[1] + 4 * sin(d->yaw)) / VOXEL);
        cells[k].k = k;
        cells[k].label = 2;
    }
    check_sr(sr_world_edit(world, cells, 3), gpu->context);
    calls_add(&scene_calls[CALL_EDIT], since);
}

static void steer(struct window* w, sr_world* world, struct drive* d, double seconds)
{
    const int space = glfwGetKey(w->glfw, GLFW_KEY_SPACE) == GLFW_PRESS;
    d->yaw += seconds * 0.8 * (glfwGetKey(w->glfw, GLFW_KEY_LEFT) == GLFW_PRESS);
    d->yaw -= seconds * 0.8 * (glfwGetKey(w->glfw, GLFW_KEY_RIGHT) == GLFW_PRESS);
    d->speed += seconds * 4 * (glfwGetKey(w->glfw, GLFW_KEY_UP) == GLFW_PRESS);
    d->speed -= seconds * 4 * (glfwGetKey(w->glfw, GLFW_KEY_DOWN) == GLFW_PRESS);
    d->position[0] += seconds * d->speed * cos(d->yaw);
    d->position[1] += seconds * d->speed * sin(d->yaw);
    if (world && space && !d->space)
        put_block(&w->gpu, world, d);
    d->space = space;
    if (glfwGetKey(w->glfw, GLFW_KEY_ESCAPE) == GLFW_PRESS)
        glfwSetWindowShouldClose(w->glfw, GLFW_TRUE);
}

/* one frame: where the camera is, and the picture; the worker generates meanwhile */
static void run_frame(struct window* w, sr_world* world, struct drive* d, int copied)
{
    const double direction[3] = {cos(d->yaw), sin(d->yaw), 0}, since = clock_now();
    sr_draw_desc draw;
    if (world)
        check_sr(sr_world_focus(world, d->position, direction, 18), w->gpu.context);
    calls_add(&scene_calls[CALL_FOCUS], since);
    scene_look(&w->scene, d->position, d->yaw, &draw);
    if (!show(w, world, &draw, copied)) {
        free_swapchain(w);
        make_swapchain(w);
    }
}

static void fly(struct window* w, sr_world* world, struct drive* d, int frames)
{
    double before = clock_now();
    int n;
    for (n = 0; n != frames && !glfwWindowShouldClose(w->glfw); ++n) {
        const double now = clock_now();
        glfwPollEvents();
        steer(w, world, d, frames < 0 ? now - before : 0.02);
        run_frame(w, world, d, n == frames - 1);
        calls_add(&scene_calls[CALL_FRAME], now);
        before = now;
    }
    gpu_wait(&w->gpu, w->timeline, w->number);
    calls_print(scene_calls, CALLS);
}

static void print_world(sr_world* world, const struct gpu* gpu)
{
    sr_world_info info = {.struct_size = sizeof info};
    check_sr(sr_world_get_info(world, &info), gpu->context);
    printf("%lu tiles, %lu splats\n", (unsigned long)info.generated, (unsigned long)info.splats);
}

int main(int argc, char** argv)
{
    static struct window w;
    struct drive d = {{1, 0, 1.7}, 0.1, 3, 0};
    struct worker worker;
    sr_world* world = NULL;
    if (argc != 2 && argc != 4) {
        fprintf(stderr, "usage: %s MODEL [FRAMES SCREENSHOT.ppm]\n", argv[0]);
        return 2;
    }
    open_window(&w);
    if (strcmp(argv[1], "-") != 0) {
        check_sr(make_street(w.gpu.context, argv[1], &world), w.gpu.context);
        worker_begin(&worker, world, w.gpu.context);
    }
    fly(&w, world, &d, argc > 3 ? atoi(argv[2]) : -1);
    if (argc == 4)
        write_ppm(argv[3], w.scene.width, w.scene.height, w.pixels.mapped,
                  pick_format(&w.gpu).format == VK_FORMAT_B8G8R8A8_UNORM);
    if (world) {
        worker_end(&worker);
        print_world(world, &w.gpu);
    }
    sr_world_destroy(world);
    close_window(&w);
    return 0;
}
