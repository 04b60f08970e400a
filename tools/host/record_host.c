/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host without a window: it has a Vulkan device of its own, lets the library generate a street on it by another
 * thread, has the splats drawn into its own command buffers, two of which are on their way at a time, draws cubes among
 * them, and writes what it sees.
 *
 *     record_host MODEL FOLDER [FRAMES [WIDTH HEIGHT [SECONDS]]]     writes FOLDER/000000.ppm and on
 *
 * With SECONDS (and FRAMES 1) it flies for so long before, while the street grows, and says how long calls kept the
 * thread that draws. MODEL -: without the library's splats, to compare. */
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

struct host {
    struct gpu gpu;
    struct scene scene;
    sr_world* world;      /* NULL: only cubes are drawn */
    VkSemaphore timeline; /* frame n reaches n */
    uint64_t number;      /* of the last frame */
    struct frame frames[FRAMES_ON_THEIR_WAY];
};

static void make_frame(struct frame* frame, const struct gpu* gpu, uint32_t width, uint32_t height)
{
    gpu_commands(gpu, 1, &frame->pool, &frame->commands);
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

/* splats, cubes, and a copy that the host can read */
static void submit_frame(const struct frame* frame, struct host* host, const sr_draw_desc* draw)
{
    const struct scene* scene = &host->scene;
    const VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    const sr_semaphore done = {host->timeline, host->number};
    check(vkBeginCommandBuffer(frame->commands, &begin) == VK_SUCCESS, "vkBeginCommandBuffer");
    scene_record(scene, host->world, draw, &done, (uint32_t)(frame - host->frames), frame->commands);
    scene_copy(scene, frame->picture.image, &frame->pixels, frame->commands);
    check(vkEndCommandBuffer(frame->commands) == VK_SUCCESS, "vkEndCommandBuffer");
    gpu_submit(&host->gpu, frame->commands, host->timeline, host->number, VK_NULL_HANDLE, VK_NULL_HANDLE);
}

/* the next frame, from x metres along the street, when the one before the last is finished */
static const struct frame* run_frame(struct host* host, double x)
{
    const double position[3] = {x, 0, 1.7}, forward[3] = {1, 0, 0};
    const struct frame* frame = &host->frames[++host->number % FRAMES_ON_THEIR_WAY];
    double since = clock_now();
    sr_draw_desc draw;
    if (host->number > FRAMES_ON_THEIR_WAY)
        gpu_wait(&host->gpu, host->timeline, host->number - FRAMES_ON_THEIR_WAY);
    calls_add(&scene_calls[CALL_FRAME_BEFORE], since);
    since = clock_now();
    if (host->world)
        check_sr(sr_world_focus(host->world, position, forward, 18), host->gpu.context);
    calls_add(&scene_calls[CALL_FOCUS], since);
    scene_look(&host->scene, position, 0.1, &draw);
    submit_frame(frame, host, &draw);
    return frame;
}

/* a block of voxels ahead is set anew from time to time, as by a player */
static void put_block(struct host* host, double x)
{
    const sr_cell cell = {(int32_t)(x / VOXEL) + 6, 2, 0, 2};
    const double since = clock_now();
    check_sr(sr_world_edit(host->world, &cell, 1), host->gpu.context);
    calls_add(&scene_calls[CALL_EDIT], since);
}

/* along the street at 5 m/s */
static double fly(struct host* host, double seconds)
{
    const double begin = clock_now();
    double x = 1, last = begin, next_block = 5;
    while (clock_now() - begin < seconds) {
        run_frame(host, x);
        calls_add(&scene_calls[CALL_FRAME], last);
        last = clock_now();
        x = 1 + 5 * (last - begin);
        if (host->world && last - begin > next_block) {
            put_block(host, x);
            next_block += 5;
        }
    }
    calls_print(scene_calls, CALLS);
    return x;
}

/* a picture of all that is wanted around the camera, whole */
static const struct frame* run_whole_frame(struct host* host, struct worker* worker, double x)
{
    const double position[3] = {x, 0, 1.7}, forward[3] = {1, 0, 0};
    const struct frame* frame;
    sr_status whole = SR_OK;
    if (host->world) {
        check_sr(sr_world_focus(host->world, position, forward, 18), host->gpu.context);
        worker_wait(worker);
    }
    do { /* again where there was too little room for all splats: there is more of it then */
        frame = run_frame(host, x);
        gpu_wait(&host->gpu, host->timeline, host->number);
        if (host->world)
            whole = sr_world_check_draws(host->world);
    } while (whole == SR_ERR_PARTIAL);
    check_sr(whole, host->gpu.context);
    return frame;
}

static void open_host(struct host* host, uint32_t width, uint32_t height)
{
    VkImageView views[FRAMES_ON_THEIR_WAY];
    int i;
    memset(host, 0, sizeof *host);
    gpu_create(&host->gpu, NULL, 0, NULL, NULL);
    host->timeline = gpu_timeline(&host->gpu);
    for (i = 0; i < FRAMES_ON_THEIR_WAY; ++i) {
        make_frame(&host->frames[i], &host->gpu, width, height);
        views[i] = host->frames[i].picture.view;
    }
    scene_create(&host->scene, &host->gpu, views, FRAMES_ON_THEIR_WAY, VK_FORMAT_R8G8B8A8_UNORM,
                 VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, width, height);
}

static void close_host(struct host* host)
{
    int i;
    gpu_wait(&host->gpu, host->timeline, host->number);
    sr_world_destroy(host->world);
    scene_destroy(&host->scene);
    for (i = 0; i < FRAMES_ON_THEIR_WAY; ++i)
        free_frame(&host->frames[i], &host->gpu);
    vkDestroySemaphore(host->gpu.device, host->timeline, NULL);
    gpu_destroy(&host->gpu);
}

int main(int argc, char** argv)
{
    const uint32_t frames = argc > 3 ? (uint32_t)atoi(argv[3]) : 3;
    const uint32_t width = argc > 5 ? (uint32_t)atoi(argv[4]) : 320, height = argc > 5 ? (uint32_t)atoi(argv[5]) : 200;
    static struct host host;
    struct worker worker;
    double x = 1;
    uint32_t n;
    if (argc < 3) {
        fprintf(stderr, "usage: %s MODEL FOLDER [FRAMES [WIDTH HEIGHT [SECONDS]]]\n", argv[0]);
        return 2;
    }
    open_host(&host, width, height);
    if (strcmp(argv[1], "-") != 0) {
        check_sr(make_street(host.gpu.context, argv[1], &host.world), host.gpu.context);
        worker_begin(&worker, host.world, host.gpu.context);
    }
    if (argc > 6)
        x = fly(&host, atof(argv[6]));
    for (n = 0; n < frames; ++n) {
        const struct frame* frame = run_whole_frame(&host, &worker, x + 0.5 * n);
        char path[1024];
        snprintf(path, sizeof path, "%s/%06u.ppm", argv[2], (unsigned)n);
        write_ppm(path, width, height, frame->pixels.mapped, 0);
    }
    printf("%u frames of %u x %u\n", (unsigned)frames, (unsigned)width, (unsigned)height);
    if (host.world)
        worker_end(&worker);
    close_host(&host);
    return 0;
}
