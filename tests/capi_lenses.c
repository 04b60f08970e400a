/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Lenses, rolling shutters, things that move and optical flow of a world: what must be the same, what lies where, and
 * what an application may get wrong. tests/capi_sensors.c has the numbers.
 *
 *     capi_lenses MODEL */
#include "tests/support/capi_car.h"
#include "tests/support/capi_memory.h"

#include <math.h>
#include <time.h>

enum { WIDTH = 64, HEIGHT = 40, PIXELS = WIDTH * HEIGHT };

struct pictures {
    float color[PIXELS * 4], normal[PIXELS * 4], depth[PIXELS * 2];
    uint32_t label[PIXELS * 2], instance[PIXELS];
};
static struct pictures first, second;

static void draw_into(sr_draw_desc* draw, struct pictures* to)
{
    memset(to, 0, sizeof *to);
    draw->color.memory = to->color;
    draw->normal.memory = to->normal;
    draw->depth.memory = to->depth;
    draw->label.memory = to->label;
    draw->instance.memory = to->instance;
}

static void draws(sr_context* context, sr_world* world, sr_draw_desc draw, struct pictures* to)
{
    draw_into(&draw, to);
    CHECK_OK(context, sr_world_draw(world, &draw));
}

static int same(void)
{
    return !memcmp(&first, &second, sizeof first);
}

static uint32_t pixels_of_car(const struct pictures* seen)
{
    uint32_t i, count = 0;
    for (i = 0; i < PIXELS; ++i)
        count += seen->instance[i] == CAR + 1;
    return count;
}

static sr_draw_desc lens(double time, uint32_t model, uint32_t shutter)
{
    sr_draw_desc draw = ahead(time, WIDTH, HEIGHT, shutter);
    draw.camera_model = model;
    if (model == SR_CAMERA_OPENCV)
        draw.distortion[0] = -0.2;
    if (model == SR_CAMERA_FISHEYE)
        draw.fx = draw.fy = 18; /* sees to all sides */
    if (model == SR_CAMERA_EQUIRECTANGULAR) {
        draw.fx = WIDTH / 6.283185307179586;
        draw.fy = HEIGHT / 3.141592653589793;
    }
    if (model == SR_CAMERA_FTHETA) {
        draw.fx = draw.fy = 1;
        draw.distortion[0] = 25;
        draw.distortion[5] = 1;
        draw.distortion[8] = 1.2;
    }
    return draw;
}

/* what is read out from one place is what a global shutter sees; a camera or a car that drives meanwhile is not */
static void only_what_moves_differs_from_a_global_shutter(sr_context* context, sr_world* world)
{
    const double turned[12] = {0.6, -0.8, 0, 3, 0, 0, -1, 1.5, 0.8, 0.6, 0, -3};
    const sr_actor car = driving_car();
    uint32_t model, shutter;
    for (model = SR_CAMERA_PINHOLE; model <= SR_CAMERA_FTHETA; ++model)
        for (shutter = SR_SHUTTER_DOWN; shutter <= SR_SHUTTER_LEFT; ++shutter) {
            sr_draw_desc global = lens(0.25, model, SR_SHUTTER_GLOBAL), rolling = lens(0.25, model, shutter);
            memcpy(global.world_to_camera, turned, sizeof turned);
            draws(context, world, global, &first);
            memset(rolling.world_to_camera, 0, sizeof rolling.world_to_camera); /* not looked at */
            draws(context, world, rolling, &second);
            CHECK(!same());
            memcpy(rolling.world_to_camera_start, turned, sizeof turned);
            memcpy(rolling.world_to_camera_end, turned, sizeof turned);
            draws(context, world, rolling, &second);
            CHECK(same());
            if (shutter != SR_SHUTTER_DOWN)
                continue;
            CHECK_OK(context, sr_world_set_actors(world, &car, 1));
            draws(context, world, global, &first);
            draws(context, world, rolling, &second);
            CHECK(!same() && pixels_of_car(&first) > 0 && pixels_of_car(&second) > 0);
            rolling.readout_start = rolling.readout_end = 0; /* at once */
            draws(context, world, rolling, &second);
            CHECK(same());
            CHECK_OK(context, sr_world_set_actors(world, NULL, 0));
        }
    draws(context, world, lens(0.25, SR_CAMERA_PINHOLE, SR_SHUTTER_GLOBAL), &first);
    {
        sr_draw_desc straight = ahead(0.25, WIDTH, HEIGHT, SR_SHUTTER_GLOBAL);
        straight.camera_model = SR_CAMERA_OPENCV;
        draws(context, world, straight, &second);
        CHECK(same());
    }
}

/* cameras of all kinds in one call, some of which go together */
static void draws_of_all_kinds_are_those_of_each(sr_context* context, sr_world* world)
{
    enum { COUNT = 12 };
    static struct pictures seen[COUNT];
    sr_draw_desc all[COUNT];
    int i;
    for (i = 0; i < COUNT; ++i) {
        all[i] = lens(0.125 * (i % 3), (uint32_t)(i / 2 % 5), i % 4 == 3 ? SR_SHUTTER_UP : SR_SHUTTER_GLOBAL);
        draw_into(&all[i], &seen[i]);
    }
    CHECK_OK(context, sr_world_draws(world, all, COUNT));
    for (i = 0; i < COUNT; ++i) {
        draws(context, world, all[i], &first);
        CHECK(!memcmp(&first, &seen[i], sizeof first));
    }
}

/* the ray of a pixel's centre, in the camera's axes and as long as depth 1 is far; models without distortion */
static void ray_of(const sr_draw_desc* d, double x, double y, double ray[3])
{
    const double a = (x - d->cx) / d->fx, b = (y - d->cy) / d->fy, angle = sqrt(a * a + b * b);
    const double pinhole[3] = {a, b, 1};
    const double fisheye[3] = {a * sin(angle) / angle, b * sin(angle) / angle, cos(angle)};
    const double around[3] = {sin(a) * cos(b), sin(b), cos(a) * cos(b)};
    memcpy(ray,
           d->camera_model == SR_CAMERA_PINHOLE   ? pinhole
           : d->camera_model == SR_CAMERA_FISHEYE ? fisheye
                                                  : around,
           sizeof pinhole);
}

/* a pick is what the pictures have there, and lies where the pixel's ray reaches it; of a rolling shutter from where
 * the camera is when the line is read */
static void picks_are_right_for_lenses(sr_context* context, sr_world* world, uint32_t model, uint32_t shutter)
{
    const sr_draw_desc draw = lens(0.25, model, shutter);
    uint32_t x, y, found_some = 0;
    draws(context, world, draw, &first);
    for (y = 3; y < HEIGHT; y += 9)
        for (x = 2; x < WIDTH; x += 11) {
            const uint32_t i = y * WIDTH + x;
            const double depth = (double)first.depth[2 * i + 1];
            const double part = shutter == SR_SHUTTER_DOWN   ? (y + 0.5) / HEIGHT - 0.5
                                : shutter == SR_SHUTTER_LEFT ? 0.5 - (x + 0.5) / WIDTH
                                                             : 0;
            sr_pick found = SR_INIT(sr_pick);
            double ray[3];
            CHECK_OK(context, sr_world_pick(world, &draw, x, y, &found));
            CHECK(found.cell.label == first.label[2 * i]);
            if (found.cell.label == SR_NO_CELL)
                continue;
            ++found_some;
            /* drawn alone, a pinhole's pixel has other coordinates in fp32 */
            CHECK(fabs(found.alpha - (double)first.color[4 * i + 3]) <= (model == 0 && shutter == 0 ? 1e-5 : 0));
            CHECK(found.instance == first.instance[i]);
            ray_of(&draw, x + 0.5, y + 0.5, ray);
            CHECK(fabs(found.position[0] - (drive(0.25 + 0.25 * part) + depth * ray[2])) < 1e-6);
            CHECK(fabs(found.position[1] - (4.75 - depth * ray[0])) < 1e-6);
            CHECK(fabs(found.position[2] - (1.5 - depth * ray[1])) < 1e-6);
            CHECK((uint32_t)(found.cell.i & 0xfff) == (first.label[2 * i + 1] & 0xfff));
        }
    CHECK(found_some > 5);
}

/* it comes with its first pose, goes with its last one, and is at a pose when it is time */
static void an_actor_is_there_between_its_poses(sr_context* context, sr_world* world)
{
    const sr_actor_pose poses[3] = {{0, {1, 0, 0, 6, 0, 1, 0, 3.9, 0, 0, 1, 1.2}},
                                    {500000, {0, -1, 0, 6, 1, 0, 0, 4.5, 0, 0, 1, 1.2}},
                                    {1000000, {1, 0, 0, 6, 0, 1, 0, 5.5, 0, 0, 1, 1.2}}};
    sr_actor car = driving_car();
    sr_draw_desc draw = ahead(0.5, WIDTH, HEIGHT, SR_SHUTTER_GLOBAL);
    car.poses = poses;
    car.pose_count = 3;
    CHECK_OK(context, sr_world_set_actors(world, &car, 1));
    draws(context, world, draw, &first);
    car.poses = &poses[1];
    car.pose_count = 1;
    CHECK_OK(context, sr_world_set_actors(world, &car, 1));
    draws(context, world, draw, &second);
    CHECK(same() && pixels_of_car(&first) > 20);
    draw.time = 1e6; /* one pose is for all times */
    draws(context, world, draw, &second);
    CHECK(same());
    car.poses = poses;
    car.pose_count = 3;
    CHECK_OK(context, sr_world_set_actors(world, &car, 1));
    draw.time = 0.75;
    draws(context, world, draw, &second);
    CHECK(!same() && pixels_of_car(&second) > 20);
    draw.time = -0.000001;
    draws(context, world, draw, &second);
    CHECK(pixels_of_car(&second) == 0);
    draw.time = 1.000001;
    draws(context, world, draw, &second);
    CHECK(pixels_of_car(&second) == 0);
    draw.time = 1.0000004; /* to the microsecond */
    draws(context, world, draw, &second);
    CHECK(pixels_of_car(&second) > 20);
    CHECK_OK(context, sr_world_set_actors(world, NULL, 0));
}

static void refuses_wrong_actors(sr_context* context, sr_world* world)
{
    sr_actor_pose poses[2] = {kCarPoses[0], kCarPoses[1]};
    sr_actor car = driving_car();
    car.poses = poses;
    car.pose_count = 0;
    CHECK(sr_world_set_actors(world, &car, 1) == SR_ERR_BAD_INPUT && says(context, "actor 0: expected one pose"));
    car.pose_count = 2;
    poses[1].time_us = 0;
    CHECK(sr_world_set_actors(world, &car, 1) == SR_ERR_BAD_INPUT && says(context, "pose 1: expected a time after 0"));
    poses[1].time_us = INT64_MAX;
    CHECK(sr_world_set_actors(world, &car, 1) == SR_ERR_BAD_INPUT && says(context, "within 2^61"));
    poses[1].time_us = 1;
    poses[1].pose[0] = 0;
    CHECK(sr_world_set_actors(world, &car, 1) == SR_ERR_BAD_INPUT && says(context, "pose 1: expected a rotation"));
    car.poses = NULL;
    CHECK(sr_world_set_actors(world, &car, 1) == SR_ERR_BAD_INPUT && says(context, "actor 0: expected one pose"));
}

static void refuses_wrong_cameras(sr_context* context, sr_world* world)
{
    sr_draw_desc draw = lens(0, SR_CAMERA_OPENCV, SR_SHUTTER_DOWN);
    draw_into(&draw, &second);
    draw.camera_model = 5;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "camera_model is 5"));
    draw.camera_model = SR_CAMERA_PINHOLE;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_BAD_INPUT && says(context, "distortion coefficient 1"));
    draw.camera_model = SR_CAMERA_EQUIRECTANGULAR;
    draw.distortion[0] = 0;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_BAD_INPUT && says(context, "whole sphere"));
    draw.camera_model = SR_CAMERA_FTHETA;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_BAD_INPUT && says(context, "polynomial"));
    draw = lens(0, SR_CAMERA_PINHOLE, SR_SHUTTER_DOWN);
    draw.shutter = 5;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "shutter is 5"));
    draw.shutter = SR_SHUTTER_UP;
    draw.readout_end = -1;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "readout_end is -1"));
    draw.readout_end = (double)NAN;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "readout_end"));
    draw = lens(0, SR_CAMERA_PINHOLE, SR_SHUTTER_DOWN);
    draw.world_to_camera_end[1] = 2;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_BAD_INPUT && says(context, "world_to_camera_end"));
    draw.world_to_camera_start[3] = (double)NAN;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_BAD_INPUT && says(context, "world_to_camera_start"));
    draw = lens(1e300, SR_CAMERA_PINHOLE, SR_SHUTTER_GLOBAL);
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "time is 1e+300"));
    draw = lens(0, SR_CAMERA_FISHEYE, SR_SHUTTER_GLOBAL); /* never looked at: it is refused before */
    draw.depth_test.image = (struct VkImage_T*)&draw;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "depth_test is for pinholes"));
    draw = lens(0, SR_CAMERA_PINHOLE, SR_SHUTTER_RIGHT);
    draw.depth_test.image = (struct VkImage_T*)&draw;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "depth_test is for pinholes"));
}

/* a road that a camera drives over, a car that drives or vanishes, and pictures that do not go together */
static void flow_follows_camera_and_car(sr_context* context, sr_world* world)
{
    static float flow[PIXELS * 2];
    static uint32_t states[PIXELS];
    const uint32_t road = (HEIGHT - 6) * WIDTH + WIDTH / 2 + 9;
    sr_actor car = driving_car();
    sr_draw_desc now = ahead(0.25, WIDTH, HEIGHT, SR_SHUTTER_GLOBAL), next = ahead(0.5, WIDTH, HEIGHT, 0);
    sr_target to_flow = {0}, to_states = {0};
    uint32_t i, moved = 0, hidden = 0, car_pixels;
    to_flow.memory = flow;
    to_states.memory = states;
    CHECK_OK(context, sr_world_flow(world, &now, &next, &to_flow, &to_states)); /* all stands */
    draws(context, world, now, &first);
    car_pixels = pixels_of_car(&first);
    { /* what is z away grows as the camera comes nearer by a quarter */
        const double z = (double)first.depth[2 * road + 1], u = 9.5 * z / (z - 0.25) - 9.5;
        CHECK(states[road] == SR_FLOW_SEEN && fabs((double)flow[2 * road] - u) < 1e-3);
    }
    next = now; /* the same place at another time */
    next.time = 0.5;
    CHECK_OK(context, sr_world_set_actors(world, &car, 1));
    CHECK_OK(context, sr_world_flow(world, &now, &next, &to_flow, &to_states));
    CHECK(states[road] == SR_FLOW_SEEN && fabsf(flow[2 * road]) < 1e-3f && fabsf(flow[2 * road + 1]) < 1e-3f);
    draws(context, world, now, &first);
    for (i = 0; i < PIXELS; ++i)
        moved += first.instance[i] == CAR + 1 && states[i] == SR_FLOW_SEEN && flow[2 * i] < -1;
    CHECK(moved > 10); /* it drives to the left */
    next.time = 1.5;   /* it is not there any more */
    CHECK_OK(context, sr_world_flow(world, &now, &next, &to_flow, &to_states));
    for (i = 0; i < PIXELS; ++i)
        hidden += first.instance[i] == CAR + 1 && states[i] == SR_FLOW_HIDDEN;
    CHECK(hidden == pixels_of_car(&first) && hidden > 20 && car_pixels > 20);
    CHECK_OK(context, sr_world_set_actors(world, NULL, 0));
    next = lens(0.5, SR_CAMERA_FISHEYE, SR_SHUTTER_GLOBAL);
    CHECK(sr_world_flow(world, &now, &next, &to_flow, &to_states) == SR_ERR_USAGE && says(context, "one camera model"));
    next = ahead(0.5, WIDTH, HEIGHT / 2, SR_SHUTTER_GLOBAL);
    CHECK(sr_world_flow(world, &now, &next, &to_flow, &to_states) == SR_ERR_USAGE && says(context, "one size"));
    CHECK(sr_world_flow(world, &now, &now, NULL, NULL) == SR_ERR_USAGE && says(context, "neither flow nor states"));
    to_flow.format = VK_FORMAT_R32_SFLOAT;
    CHECK(sr_world_flow(world, &now, &now, &to_flow, NULL) == SR_ERR_USAGE && says(context, "flow cannot have format"));
    to_flow.format = VK_FORMAT_R32G32_SFLOAT;
    CHECK(sr_world_flow(world, &now, NULL, &to_flow, NULL) == SR_ERR_USAGE && says(context, "sr_draw_desc: NULL"));
    CHECK(sr_world_flow(NULL, &now, &now, &to_flow, NULL) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    CHECK_OK(context, sr_world_flow(world, &now, &now, &to_flow, NULL));
}

/* a hundred of ten thousand objects drive, every frame anew: that takes time by the hundred */
static void many_objects_drive(sr_context* context, const sr_grid* grid)
{
    enum { OBJECTS = 10000, ACTORS = 100, FRAMES = 50 };
    static sr_object objects[OBJECTS];
    static sr_actor actors[ACTORS];
    sr_world* world;
    clock_t begin;
    int i;
    for (i = 0; i < OBJECTS; ++i) {
        objects[i] = car_object();
        objects[i].id = i ? (uint32_t)(100 + i) : CAR;
        objects[i].center[0] += 10 * i;
    }
    for (i = 0; i < ACTORS; ++i) {
        actors[i] = driving_car();
        actors[i].object = objects[i].id;
    }
    world = car_world_with(context, grid, objects, OBJECTS);
    begin = clock();
    for (i = 0; i < FRAMES; ++i)
        CHECK_OK(context, sr_world_set_actors(world, actors, ACTORS));
    printf("%d actors of %d objects: %.1f us a call\n", ACTORS, OBJECTS,
           1e6 * (double)(clock() - begin) / CLOCKS_PER_SEC / FRAMES);
    draws(context, world, ahead(0.25, WIDTH, HEIGHT, SR_SHUTTER_GLOBAL), &first);
    CHECK(pixels_of_car(&first) > 20);
    sr_world_destroy(world);
}

/* recorded into a host's command buffer: lenses that are read out line by line, too */
static void records_lenses(const char* model)
{
    struct host host = make_host();
    sr_context* context = adopt_host(&host);
    sr_grid* grid = car_points(context, model);
    sr_world* world = car_world(context, grid);
    const sr_actor car = driving_car();
    const struct host_buffer buffer = make_buffer(&host, sizeof first.color);
    uint32_t kind;
    CHECK_OK(context, sr_world_set_actors(world, &car, 1));
    for (kind = 0; kind < 2; ++kind) {
        const struct host_commands commands = begin_commands(&host);
        sr_draw_desc draw = lens(0.25, SR_CAMERA_FISHEYE, kind ? SR_SHUTTER_DOWN : SR_SHUTTER_GLOBAL);
        draws(context, world, draw, &first);
        draw.color.buffer = buffer.buffer;
        CHECK_OK(context, sr_world_record(world, &draw, commands.commands));
        CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
        run_commands(&host, &commands);
        CHECK(!memcmp(buffer.mapped, first.color, sizeof first.color) && pixels_of_car(&first) > 20);
        CHECK_OK(context, sr_world_check_draws(world));
        vkDestroyCommandPool(host.device, commands.pool, NULL);
    }
    sr_world_destroy(world);
    sr_grid_destroy(grid);
    sr_context_destroy(context);
    destroy_buffer(&host, &buffer);
    destroy_host(&host);
}

int main(int argc, char** argv)
{
    sr_context* context = NULL;
    sr_grid* grid;
    sr_world* world;
    CHECK(argc == 2);
    sr_set_diagnostic_callback(print_line, stderr);
    CHECK(sr_context_create(NULL, &context) == SR_OK);
    grid = car_points(context, argv[1]);
    world = car_world(context, grid);
    only_what_moves_differs_from_a_global_shutter(context, world);
    draws_of_all_kinds_are_those_of_each(context, world);
    picks_are_right_for_lenses(context, world, SR_CAMERA_PINHOLE, SR_SHUTTER_GLOBAL);
    picks_are_right_for_lenses(context, world, SR_CAMERA_PINHOLE, SR_SHUTTER_DOWN);
    picks_are_right_for_lenses(context, world, SR_CAMERA_FISHEYE, SR_SHUTTER_GLOBAL);
    picks_are_right_for_lenses(context, world, SR_CAMERA_FISHEYE, SR_SHUTTER_LEFT);
    picks_are_right_for_lenses(context, world, SR_CAMERA_EQUIRECTANGULAR, SR_SHUTTER_GLOBAL);
    an_actor_is_there_between_its_poses(context, world);
    flow_follows_camera_and_car(context, world);
    refuses_wrong_actors(context, world);
    refuses_wrong_cameras(context, world);
    sr_world_destroy(world);
    many_objects_drive(context, grid);
    sr_grid_destroy(grid);
    sr_context_destroy(context);
    records_lenses(argv[1]);
    return 0;
}
