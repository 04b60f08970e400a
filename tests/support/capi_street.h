/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A street without end for tests in C, and a walk along it. */
#ifndef SEMROVER_TESTS_CAPI_STREET_H
#define SEMROVER_TESTS_CAPI_STREET_H

#include "tests/support/capi_vulkan.h"

enum { MOST_CELLS = 4096 };

/* a road with a wall beside it */
static uint32_t label_of(int32_t j)
{
    return j == 6 ? 2 : 0;
}
static uint64_t cells_of(const sr_cell_rect* window, sr_cell* cells)
{
    uint64_t count = 0;
    int32_t i, j, k;
    for (i = window->low[0]; i <= window->high[0]; ++i)
        for (j = window->low[1]; j <= window->high[1]; ++j)
            for (k = 0; k < (j == 6 ? 4 : 1); ++k)
                if (j >= -6 && j <= 6) {
                    CHECK(count < MOST_CELLS);
                    cells[count].i = i;
                    cells[count].j = j;
                    cells[count].k = k;
                    cells[count++].label = label_of(j);
                }
    return count;
}

/* the labels callback; `broken` makes it fail, with SR_NOT_YET where it is that */
static int broken, calls;
static sr_status labels(void* user, const sr_cell_rect* window, sr_grid* grid)
{
    static sr_cell cells[MOST_CELLS];
    CHECK(user == &calls);
    ++calls;
    if (broken)
        return broken == SR_NOT_YET ? SR_NOT_YET : SR_ERR_BAD_INPUT;
    return sr_grid_set_cells(grid, cells, cells_of(window, cells));
}

/* of a world with splats: small tiles, two steps; the model is still to be said */
static inline sr_world_desc street_world(void)
{
    sr_world_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.steps = 2;
    desc.tile_size = 4.8;
    desc.labels = labels;
    desc.user = &calls;
    desc.splat_bytes = 2u << 20;
    return desc;
}

static inline sr_model_desc model_at(const char* path)
{
    sr_model_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.path = path;
    return desc;
}
static inline sr_model* load_model(sr_context* context, const char* path)
{
    const sr_model_desc desc = model_at(path);
    sr_model* model = NULL;
    CHECK_OK(context, sr_model_load(context, &desc, &model));
    return model;
}

/* with a model of its own, which stays as long as what is made with it */
static inline sr_status create_world(sr_context* context, const char* path, sr_world_desc* desc, sr_world** world)
{
    const sr_model_desc model_desc = model_at(path);
    sr_model* model = NULL;
    sr_status status = sr_model_load(context, &model_desc, &model);
    desc->model = model;
    if (status == SR_OK)
        status = sr_world_create(context, desc, world);
    sr_model_destroy(model);
    return status;
}
static inline sr_status create_renderer(sr_context* context, const char* path, sr_renderer_desc* desc,
                                        sr_renderer** renderer)
{
    const sr_model_desc model_desc = model_at(path);
    sr_model* model = NULL;
    sr_status status = sr_model_load(context, &model_desc, &model);
    desc->model = model;
    if (status == SR_OK)
        status = sr_renderer_create(context, desc, renderer);
    sr_model_destroy(model);
    return status;
}

/* until all around x is there */
static inline void walk(sr_context* context, sr_world* world, double x, double radius)
{
    const double position[3] = {x, 0, 1.5}, forward[3] = {1, 0, 0};
    uint32_t done = 0, steps = 0;
    CHECK_OK(context, sr_world_focus(world, position, forward, radius));
    for (; !done; ++steps) {
        CHECK_OK(context, sr_world_step(world, 20000, &done));
        CHECK(steps < 10000);
    }
}

/* a camera at (x, 0, 1.5) that looks along x */
static void look(double x, double world_to_camera[12])
{
    const double to_camera[12] = {0, -1, 0, 0, 0, 0, -1, 1.5, 1, 0, 0, 0};
    memcpy(world_to_camera, to_camera, sizeof to_camera);
    world_to_camera[11] = -x;
}
static inline sr_draw_desc camera_at(double x, uint32_t width, uint32_t height)
{
    sr_draw_desc draw;
    memset(&draw, 0, sizeof draw);
    draw.struct_size = sizeof draw;
    draw.width = width;
    draw.height = height;
    draw.fx = draw.fy = draw.cx = width / 2;
    draw.cy = height / 2;
    look(x, draw.world_to_camera);
    return draw;
}

static inline sr_world_info world_info(sr_world* world)
{
    sr_world_info info;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK(sr_world_get_info(world, &info) == SR_OK);
    return info;
}

#endif
