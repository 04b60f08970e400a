/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A car on a road beside a wall, for tests in C: all of it in one tile, with points, in a world without a model. */
#ifndef SEMROVER_TESTS_CAPI_CAR_H
#define SEMROVER_TESTS_CAPI_CAR_H

#include "tests/support/capi_street.h"

enum { CAR = 17, CAR_LABEL = 13 };
static const double kCarCenter[3] = {6, 3.9, 1.2}, kCarSize[3] = {2.4, 1.8, 1.2}, kSplatRadius = 0.1;

/* where a vehicle is that drives along x, and what is on it */
static inline double drive(double seconds)
{
    return 0.5 + seconds;
}

static inline sr_object car_object(void)
{
    sr_object car;
    memset(&car, 0, sizeof car);
    car.id = CAR;
    car.label = CAR_LABEL;
    memcpy(car.center, kCarCenter, sizeof kCarCenter);
    memcpy(car.size, kCarSize, sizeof kCarSize);
    return car;
}

/* labels of 16 x 16 columns */
static inline uint64_t car_cells(sr_cell* cells)
{
    uint64_t count = 0;
    int32_t i, j, k;
    for (i = 0; i < 16; ++i)
        for (j = 0; j < 16; ++j)
            for (k = 0; k < 4; ++k) {
                const int car = i >= 8 && i < 12 && j >= 5 && j < 8 && (k == 1 || k == 2), wall = j == 13;
                sr_cell cell = {0, 0, 0, 0};
                if (k > 0 && !car && !wall)
                    continue;
                cell.i = i;
                cell.j = j;
                cell.k = k;
                cell.label = car ? CAR_LABEL : wall ? 2 : 0;
                cells[count++] = cell;
            }
    return count;
}

/* with points that a model made */
static inline sr_grid* car_points(sr_context* context, const char* model)
{
    static sr_cell cells[1024];
    const sr_cell_rect everywhere = {{-99, -99}, {99, 99}};
    sr_world_desc desc;
    sr_grid *labels_only = NULL, *grid = NULL;
    sr_world* world = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    CHECK(sr_grid_create(0.6, &labels_only) == SR_OK);
    CHECK(sr_grid_set_cells(labels_only, cells, car_cells(cells)) == SR_OK);
    desc.grid = labels_only;
    desc.steps = 2;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 4, 20);
    CHECK_OK(context, sr_world_copy_cells(world, &everywhere, &grid));
    sr_world_destroy(world);
    sr_grid_destroy(labels_only);
    return grid;
}

static inline sr_world* car_world_with(sr_context* context, const sr_grid* grid, const sr_object* objects,
                                       uint64_t count)
{
    sr_world_desc desc;
    sr_world* world = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.grid = grid;
    desc.conditioning = SR_CONDITIONING_GIVEN;
    desc.objects = objects;
    desc.object_count = count;
    desc.splat_bytes = 2u << 20;
    desc.splat_radius = kSplatRadius;
    CHECK_OK(context, sr_world_create(context, &desc, &world));
    walk(context, world, 4, 20);
    CHECK(world_info(world).splats > 5000);
    return world;
}

static inline sr_world* car_world(sr_context* context, const sr_grid* grid)
{
    const sr_object car = car_object();
    return car_world_with(context, grid, &car, 1);
}

/* from the vehicle at x, 1.5 m above the road, along x */
static inline void look_ahead(double x, double world_to_camera[12])
{
    look(x, world_to_camera);
    world_to_camera[3] = 4.75;
}

/* a pinhole of the drive; with `shutter` it is read out from an eighth of a second before its time to one after it */
static inline sr_draw_desc ahead(double time, uint32_t width, uint32_t height, uint32_t shutter)
{
    sr_draw_desc draw = camera_at(drive(time), width, height);
    draw.time = time;
    look_ahead(drive(time), draw.world_to_camera);
    draw.shutter = shutter;
    if (shutter != SR_SHUTTER_GLOBAL) {
        draw.readout_start = -0.125;
        draw.readout_end = 0.125;
        look_ahead(drive(time - 0.125), draw.world_to_camera_start);
        look_ahead(drive(time + 0.125), draw.world_to_camera_end);
    }
    return draw;
}

/* the car drives to the left and turns around within a second */
static const sr_actor_pose kCarPoses[2] = {{0, {1, 0, 0, 6, 0, 1, 0, 3.9, 0, 0, 1, 1.2}},
                                           {1000000, {-1, 0, 0, 6.5, 0, -1, 0, 5.75, 0, 0, 1, 1.2}}};
static inline sr_actor driving_car(void)
{
    sr_actor car;
    car.object = CAR;
    car.pose_count = 2;
    car.poses = kCarPoses;
    return car;
}

#endif
