/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What hosts that meet faults do: a world that is generated, drawn, edited and drawn again, and frames that are refined
 * of it, a chain. A host defines before_call() and again(), and may so have a call made more than once. */
#ifndef SEMROVER_TESTS_FAULTS_SESSION_H
#define SEMROVER_TESTS_FAULTS_SESSION_H

#include "tests/support/capi_street.h"

enum { WIDTH = 52, HEIGHT = 40, PIXELS = WIDTH * HEIGHT, FRAMES = 2 };

struct session {
    const char *model, *weights; /* weights: of a renderer; NULL: nothing is refined */
    sr_context* context;
    sr_world* world;
    sr_renderer* renderer;
    uint64_t hash; /* of all pictures */
};

static void before_call(int attempt); /* from 0 on */
/* whether the call is made again */
static int again(const struct session* s, const char* call, sr_status status, int attempt);

#define GO(call)                                                                                                       \
    do {                                                                                                               \
        int go_attempt = 0;                                                                                            \
        sr_status go_status;                                                                                           \
        do {                                                                                                           \
            before_call(go_attempt);                                                                                   \
            go_status = (call);                                                                                        \
        } while (again(s, #call, go_status, go_attempt++));                                                            \
        if (go_status != SR_OK)                                                                                        \
            return go_status;                                                                                          \
    } while (0)

static void add_to_hash(struct session* s, const void* bytes, size_t count) /* FNV-1a */
{
    const unsigned char* byte = (const unsigned char*)bytes;
    size_t i;
    for (i = 0; i < count; ++i)
        s->hash = (s->hash ^ byte[i]) * 1099511628211u;
}

static sr_status open_context(sr_context** context)
{
    sr_context_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    return sr_context_create(&desc, context);
}

static sr_status open_world(struct session* s, const char* cache)
{
    sr_world_desc desc = street_world();
    desc.cache = cache;
    return create_world(s->context, s->model, &desc, &s->world);
}

static sr_status open_renderer(struct session* s)
{
    sr_renderer_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.steps = 2;
    desc.noise = SR_NOISE_ON_SURFACES;
    return create_renderer(s->context, s->weights, &desc, &s->renderer);
}

static sr_status focus_world(struct session* s)
{
    const double position[3] = {1, 0, 1.5}, forward[3] = {1, 0, 0};
    return sr_world_focus(s->world, position, forward, 4);
}

static sr_status edit_world(struct session* s)
{
    const sr_cell cells[2] = {{6, 0, 0, 2}, {6, 0, 1, 2}};
    return sr_world_edit(s->world, cells, 2);
}

static sr_status draw_world(struct session* s)
{
    static float color[PIXELS * 4];
    sr_draw_desc draw = camera_at(1, WIDTH, HEIGHT);
    sr_status status;
    draw.color.memory = color;
    status = sr_world_draw(s->world, &draw);
    if (status == SR_OK)
        add_to_hash(s, color, sizeof color);
    return status;
}

/* an error gives the frame up: so it is one call, from its begin on */
static sr_status refine_frame(struct session* s, int number)
{
    sr_frame_desc frame;
    uint32_t done = 0;
    sr_status status;
    memset(&frame, 0, sizeof frame);
    frame.struct_size = sizeof frame;
    frame.world = s->world;
    frame.fx = frame.fy = frame.cx = WIDTH / 2;
    frame.cy = HEIGHT / 2;
    look(1 + 0.5 * number, frame.world_to_camera);
    status = sr_renderer_begin(s->renderer, &frame);
    while (status == SR_OK && !done)
        status = sr_renderer_step(s->renderer, 0, &done);
    return status;
}

static sr_status take_frame(struct session* s)
{
    static uint8_t pixels[PIXELS * 4];
    sr_target target;
    sr_status status;
    memset(&target, 0, sizeof target);
    target.memory = pixels;
    status = sr_renderer_take(s->renderer, &target);
    if (status == SR_OK)
        add_to_hash(s, pixels, sizeof pixels);
    return status;
}

static sr_status fill_world(struct session* s)
{
    uint32_t done = 0;
    while (!done)
        GO(sr_world_step(s->world, 0, &done));
    return SR_OK;
}

static void end(struct session* s)
{
    sr_renderer_destroy(s->renderer);
    sr_world_destroy(s->world);
    sr_context_destroy(s->context);
    s->renderer = NULL;
    s->world = NULL;
    s->context = NULL;
}

#endif
