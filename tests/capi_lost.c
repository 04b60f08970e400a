/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host whose GPU is lost at one of its submits: each call says so with a status and a line, everything can be
 * destroyed, and another context goes on. The GPU is lost by the layer of tests/vendors/failing_gpu.cpp. capi_lost
 * MODEL */
#include "tests/support/capi_street.h"

#include <sys/wait.h>
#include <unistd.h>

enum { PICTURE = 16 };
static const char* model;

static sr_status open_street(sr_context* context, sr_world** world)
{
    sr_world_desc desc = street_world();
    return create_world(context, model, &desc, world);
}

/* until the street around the origin is there, or a call fails; then a picture of it */
static sr_status live(sr_context* context, sr_world** world)
{
    static float color[PICTURE * PICTURE * 4];
    const double position[3] = {0, 0, 1.5}, forward[3] = {1, 0, 0};
    sr_draw_desc draw = camera_at(0, PICTURE, PICTURE);
    uint32_t done = 0;
    sr_status status = *world ? SR_OK : open_street(context, world);
    if (status == SR_OK)
        status = sr_world_focus(*world, position, forward, 8);
    while (status == SR_OK && !done)
        status = sr_world_step(*world, 0, &done);
    if (status != SR_OK)
        return status;
    draw.color.memory = color;
    return sr_world_draw(*world, &draw);
}

static void check_lost(const sr_context* context, sr_status status)
{
    CHECK(status == SR_ERR_DEVICE_LOST);
    CHECK(says(context, "VK_ERROR_DEVICE_LOST"));
}

/* in a process of its own: the layer counts submits for the life of one */
static void loses_it_at(const char* submit)
{
    sr_context_desc desc;
    sr_context* context = NULL;
    sr_world* world = NULL;
    sr_status status;
    setenv("FAILING_GPU_AT", submit, 1);
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    CHECK(sr_context_create(&desc, &context) == SR_OK);
    status = live(context, &world);
    fprintf(stderr, "lost at submit %s: %s\n", submit, sr_status_name(status));
    check_lost(context, status);
    check_lost(context, live(context, &world)); /* and the next call, too */
    sr_world_destroy(world);
    sr_context_destroy(context);

    context = NULL; /* the second device of the process is not lost */
    world = NULL;
    CHECK(sr_context_create(&desc, &context) == SR_OK);
    CHECK_OK(context, live(context, &world));
    CHECK(world_info(world).finished == world_info(world).wanted);
    sr_world_destroy(world);
    sr_context_destroy(context);
}

int main(int argc, char** argv)
{
    const char* counts[] = {"1", "4", "11", "31", "61"};
    size_t i;
    CHECK(argc == 2);
    model = argv[1];
    for (i = 0; i < sizeof counts / sizeof *counts; ++i) {
        int ended = 0;
        const pid_t child = fork();
        CHECK(child >= 0);
        if (!child) {
            loses_it_at(counts[i]);
            exit(0);
        }
        CHECK(waitpid(child, &ended, 0) == child && WIFEXITED(ended) && WEXITSTATUS(ended) == 0);
    }
    return 0;
}
