/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host without a window: it has a Vulkan device of its own, lets the library generate a street on it, has the splats
 * drawn into its own command buffer, draws cubes among them, and writes what it sees.
 *
 *     record_host MODEL FOLDER [FRAMES [WIDTH HEIGHT]]     writes FOLDER/000000.ppm and on */
#include "scene.h"
#include "street.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct frame {
    VkCommandPool pool;
    VkCommandBuffer commands;
    struct image picture;
    struct buffer pixels; /* of the picture, where the host sees them */
};

static void make_frame(struct frame* frame, const struct gpu* gpu, uint32_t width, uint32_t height)
{
    const VkCommandPoolCreateInfo pool = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                          .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
                                          .queueFamilyIndex = gpu->family};
    VkCommandBufferAllocateInfo commands = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                            .commandBufferCount = 1};
    check(vkCreateCommandPool(gpu->device, &pool, NULL, &frame->pool) == VK_SUCCESS, "vkCreateCommandPool");
    commands.commandPool = frame->pool;
    check(vkAllocateCommandBuffers(gpu->device, &commands, &frame->commands) == VK_SUCCESS, "vkAllocateCommandBuffers");
    frame->picture =
        gpu_image(gpu, width, height, VK_FORMAT_R8G8B8A8_UNORM,
                  VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT, VK_IMAGE_ASPECT_COLOR_BIT);
    frame->pixels = gpu_buffer(gpu, (VkDeviceSize)width * height * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT, 1);
}

static void free_frame(struct frame* frame, const struct gpu* gpu)
{
    gpu_free_buffer(gpu, &frame->pixels);
    gpu_free_image(gpu, &frame->picture);
    vkDestroyCommandPool(gpu->device, frame->pool, NULL);
}

/* splats, cubes, and a copy that the host can read; waits for all of it */
static void run_frame(const struct frame* frame, const struct scene* scene, sr_world* world, const sr_draw_desc* draw)
{
    const VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    const VkBufferImageCopy region = {.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                                      .imageExtent = {scene->width, scene->height, 1}};
    const VkBufferMemoryBarrier seen = {.sType = VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER,
                                        .srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                        .dstAccessMask = VK_ACCESS_HOST_READ_BIT,
                                        .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                        .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                        .buffer = frame->pixels.buffer,
                                        .size = VK_WHOLE_SIZE};
    const VkSubmitInfo submit = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &frame->commands};
    check(vkBeginCommandBuffer(frame->commands, &begin) == VK_SUCCESS, "vkBeginCommandBuffer");
    scene_record(scene, world, draw, 0, frame->commands);
    vkCmdCopyImageToBuffer(frame->commands, frame->picture.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                           frame->pixels.buffer, 1, &region);
    vkCmdPipelineBarrier(frame->commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 0, NULL, 1,
                         &seen, 0, NULL);
    check(vkEndCommandBuffer(frame->commands) == VK_SUCCESS, "vkEndCommandBuffer");
    check(vkQueueSubmit(scene->gpu->queue, 1, &submit, VK_NULL_HANDLE) == VK_SUCCESS, "vkQueueSubmit");
    check(vkQueueWaitIdle(scene->gpu->queue) == VK_SUCCESS, "vkQueueWaitIdle");
}

static void write_ppm(const char* folder, uint32_t number, uint32_t width, uint32_t height, const unsigned char* rgba)
{
    char path[1024];
    FILE* file;
    size_t i;
    snprintf(path, sizeof path, "%s/%06u.ppm", folder, (unsigned)number);
    file = fopen(path, "wb");
    check(file != NULL, path);
    fprintf(file, "P6 %u %u 255\n", (unsigned)width, (unsigned)height);
    for (i = 0; i < (size_t)width * height; ++i)
        fwrite(rgba + 4 * i, 1, 3, file);
    check(fclose(file) == 0, path);
}

/* all that is wanted around the camera; a game takes one step a frame instead, as vulkan_host does */
static void generate(sr_context* context, sr_world* world, const double position[3])
{
    const double forward[3] = {1, 0, 0};
    uint32_t done = 0;
    check_sr(sr_world_focus(world, position, forward, 18), context);
    while (!done)
        check_sr(sr_world_step(world, 20000, &done), context);
}

int main(int argc, char** argv)
{
    const uint32_t frames = argc > 3 ? (uint32_t)atoi(argv[3]) : 3;
    const uint32_t width = argc > 5 ? (uint32_t)atoi(argv[4]) : 320, height = argc > 5 ? (uint32_t)atoi(argv[5]) : 200;
    struct gpu gpu;
    struct frame frame;
    struct scene scene;
    sr_world* world;
    uint32_t n;
    if (argc < 3) {
        fprintf(stderr, "usage: %s MODEL FOLDER [FRAMES [WIDTH HEIGHT]]\n", argv[0]);
        return 2;
    }
    gpu_create(&gpu, NULL, 0, NULL, NULL);
    make_frame(&frame, &gpu, width, height);
    scene_create(&scene, &gpu, &frame.picture.view, 1, VK_FORMAT_R8G8B8A8_UNORM, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                 width, height);
    check_sr(make_street(gpu.context, argv[1], &world), gpu.context);
    for (n = 0; n < frames; ++n) {
        const double position[3] = {1 + 0.5 * n, 0, 1.7};
        sr_draw_desc draw;
        sr_status whole;
        generate(gpu.context, world, position);
        scene_look(&scene, position, 0.1, &draw);
        do { /* again where there was too little room for all splats: there is more of it then */
            run_frame(&frame, &scene, world, &draw);
            whole = sr_world_check_draws(world);
        } while (whole == SR_ERR_PARTIAL);
        check_sr(whole, gpu.context);
        write_ppm(argv[2], n, width, height, frame.pixels.mapped);
    }
    printf("%u frames of %u x %u\n", (unsigned)frames, (unsigned)width, (unsigned)height);
    sr_world_destroy(world);
    scene_destroy(&scene);
    free_frame(&frame, &gpu);
    gpu_destroy(&gpu);
    return 0;
}
