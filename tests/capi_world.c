/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C that streams a world: labels of a grid and of a callback, budgets, edits, splats, pictures in host memory
 * and in buffers and images of its own device; and what it may get wrong. */
#include "tests/support/capi_memory.h"
#include "tests/support/capi_street.h"

#include <math.h>
#include <time.h>

enum { WIDTH = 64, HEIGHT = 40, PIXELS = WIDTH * HEIGHT };

static const char *model, *conditioned;

static sr_grid* street(void)
{
    static sr_cell cells[MOST_CELLS];
    const sr_cell_rect all = {{-40, -40}, {40, 40}};
    sr_grid* grid = NULL;
    CHECK(sr_grid_create(0.6, &grid) == SR_OK);
    CHECK(sr_grid_set_cells(grid, cells, cells_of(&all, cells)) == SR_OK);
    return grid;
}

/* 100,000 voxels by 16 take no more than a few times as long as at once: each piece costs what it has, not the grid */
static void grids_grow_in_pieces(void)
{
    enum { COUNT = 100000, PIECE = 16 };
    static sr_cell cells[COUNT];
    sr_cell last;
    sr_grid* grids[2] = {NULL, NULL};
    double seconds[2];
    sr_grid_info info;
    uint64_t written = 0;
    int32_t i, n;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    for (n = 0; n < COUNT; ++n) {
        cells[n].i = n % 317;
        cells[n].j = n / 317;
        cells[n].k = n % 3;
        cells[n].label = 0;
    }
    for (i = 0; i < 2; ++i) {
        const int32_t piece = i ? PIECE : COUNT;
        const clock_t begin = clock();
        CHECK(sr_grid_create(0.6, &grids[i]) == SR_OK);
        for (n = 0; n < COUNT; n += piece)
            CHECK(sr_grid_set_cells(grids[i], cells + n, (uint64_t)piece) == SR_OK);
        CHECK(sr_grid_get_info(grids[i], &info) == SR_OK && info.cells == COUNT);
        seconds[i] = (double)(clock() - begin) / CLOCKS_PER_SEC;
        CHECK(sr_grid_get_cells(grids[i], COUNT - 1, 1, &last, &written) == SR_OK && written == 1 && last.i == 316);
        sr_grid_destroy(grids[i]);
    }
    printf("voxels at once %.3f s, in pieces %.3f s\n", seconds[0], seconds[1]);
    CHECK(seconds[1] < 5 * seconds[0] + 0.5);
}

/* all numbers of a window's points; the caller frees them */
static float* points_of(sr_world* world, const sr_cell_rect* window, uint64_t* cells)
{
    sr_grid* grid = NULL;
    sr_grid_info info;
    uint64_t written = 0;
    float* points;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK(sr_world_copy_cells(world, window, &grid) == SR_OK);
    CHECK(sr_grid_get_info(grid, &info) == SR_OK);
    points = malloc((size_t)(info.cells * 20 * 6 * sizeof(float)) + 1);
    if (info.cells) {
        CHECK(info.points_per_voxel == 20);
        CHECK(sr_grid_get_points(grid, 0, info.cells, points, &written) == SR_OK && written == info.cells);
    }
    sr_grid_destroy(grid);
    *cells = info.cells;
    return points;
}

static void edits_grids_cell_by_cell(void)
{
    const sr_cell set[4] = {{1, 0, 0, 0}, {0, 0, 0, 2}, {1, 0, 0, 1}, {5, 5, 5, SR_NO_CELL}};
    const sr_cell wrong[2] = {{0, 0, 0, 1}, {0, 0, 0, 20}}, far = {1 << 21, 0, 0, 0}, gone = {0, 0, 0, SR_NO_CELL};
    sr_cell cells[4];
    sr_grid* grid = NULL;
    sr_grid_info info;
    uint64_t written = 0;
    float point[6];
    CHECK(sr_grid_create(-1, &grid) == SR_ERR_BAD_INPUT && says(NULL, "voxel size") && !grid);
    CHECK(sr_grid_create(0.6, NULL) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_grid_read("/nonesuch.sgrid", &grid) == SR_ERR_BAD_INPUT && !grid);
    CHECK(sr_grid_create(0.6, &grid) == SR_OK);
    CHECK(sr_grid_set_cells(grid, set, 4) == SR_OK);
    CHECK(sr_grid_set_cells(grid, wrong, 2) == SR_ERR_BAD_INPUT && says(NULL, "voxel 1 of 2 has label 20"));
    CHECK(sr_grid_set_cells(grid, &far, 1) == SR_ERR_BAD_INPUT && says(NULL, "beyond"));
    CHECK(sr_grid_set_cells(grid, NULL, 1) == SR_ERR_USAGE && says(NULL, "cells is NULL"));
    memset(&info, 0, sizeof info);
    CHECK(sr_grid_get_info(grid, &info) == SR_ERR_USAGE && says(NULL, "struct_size"));
    info.struct_size = sizeof info;
    CHECK(sr_grid_get_info(grid, &info) == SR_OK && info.cells == 2 && info.points_per_voxel == 0);
    CHECK(info.voxel_size == 0.6);
    CHECK(sr_grid_get_cells(grid, 0, 4, cells, &written) == SR_OK && written == 2);
    CHECK(cells[0].i == 0 && cells[0].label == 2 && cells[1].i == 1 && cells[1].label == 1);
    CHECK(sr_grid_get_cells(grid, 1, 4, cells, &written) == SR_OK && written == 1 && cells[0].i == 1);
    CHECK(sr_grid_get_cells(grid, 7, 4, cells, &written) == SR_OK && written == 0);
    CHECK(sr_grid_get_points(grid, 0, 1, point, &written) == SR_ERR_BAD_INPUT && says(NULL, "no points"));
    CHECK(sr_grid_set_cells(grid, &gone, 1) == SR_OK && sr_grid_get_info(grid, &info) == SR_OK && info.cells == 1);
    sr_grid_destroy(grid);
    sr_grid_destroy(NULL);
}

static void refuses_wrong_worlds(sr_context* context)
{
    sr_world_desc desc = street_world();
    sr_world* world = (sr_world*)&desc;
    sr_draw_desc draw;
    sr_splats splats;
    const double origin[3] = {0, 0, 0};
    CHECK(sr_world_create(context, NULL, &world) == SR_ERR_USAGE && says(context, "NULL") && !world);
    desc.struct_size = 0;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_USAGE && says(context, "struct_size"));
    desc = street_world();
    desc.folder = "nonesuch";
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE &&
          says(context, "one of grid, folder and labels"));
    desc.labels = NULL;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_BAD_INPUT && says(context, "nonesuch"));
    desc = street_world();
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_USAGE && says(context, "without a model"));
    desc = street_world();
    desc.tile_size = 1.2;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE && says(context, "narrower than its halo"));
    desc = street_world();
    desc.conditioning = 3;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE && says(context, "conditioning is 3"));
    desc.conditioning = SR_CONDITIONING_GIVEN;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE && says(context, "come together"));
    desc = street_world();
    desc.detail_distance = -1;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE && says(context, "detail_distance is -1"));
    desc = street_world();
    desc.splat_bytes = 0;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    memset(&splats, 0, sizeof splats);
    splats.struct_size = sizeof splats;
    CHECK(sr_world_get_splats(world, &splats) == SR_ERR_USAGE && says(context, "without splat_bytes"));
    memset(&draw, 0, sizeof draw);
    draw.struct_size = sizeof draw;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "without splat_bytes"));
    CHECK(sr_world_focus(world, origin, NULL, 1) == SR_ERR_USAGE && says(context, "NULL"));
    CHECK(sr_world_focus(world, origin, origin, -1) == SR_ERR_USAGE && says(context, "radius"));
    CHECK(sr_world_focus(NULL, origin, origin, 1) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    sr_world_destroy(world);
    sr_world_destroy(NULL);
}

/* a grid and a callback that say the same give the same world, whichever way the camera came */
static void labels_of_a_grid_and_of_a_callback_give_the_same_points(sr_context* context)
{
    const sr_cell_rect place = {{0, -6}, {15, 6}}, everywhere = {{-999, -999}, {999, 999}};
    sr_world_desc desc = street_world();
    sr_world *called = NULL, *read = NULL;
    sr_grid* grid = street();
    uint64_t a_cells = 0, b_cells = 0;
    float *a, *b;
    broken = 1;
    CHECK_OK(context, create_world(context, model, &desc, &called));
    {
        const double position[3] = {8, 0, 1.5};
        CHECK_OK(context, sr_world_focus(called, position, position, 3));
        CHECK(sr_world_step(called, 0, NULL) == SR_ERR_BAD_INPUT &&
              says(context, "callback returned SR_ERR_BAD_INPUT"));
    }
    broken = SR_NOT_YET;
    walk(context, called, 20, 2);
    CHECK(world_info(called).finished == 0 && world_info(called).wanted > 0);
    broken = 0;
    CHECK(sr_world_labels_ready(called, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    CHECK_OK(context, sr_world_labels_ready(called, &everywhere));
    walk(context, called, 20, 2);
    CHECK(world_info(called).finished == world_info(called).wanted);
    walk(context, called, 14, 3);
    walk(context, called, 4.8, 5);
    CHECK(calls > 10);
    desc.labels = NULL;
    desc.grid = grid;
    CHECK_OK(context, create_world(context, model, &desc, &read));
    sr_grid_destroy(grid);
    walk(context, read, 4.8, 5);
    a = points_of(called, &place, &a_cells);
    b = points_of(read, &place, &b_cells);
    CHECK(a_cells == 16 * 16 && b_cells == a_cells);
    CHECK(!memcmp(a, b, (size_t)a_cells * 20 * 6 * sizeof(float)));
    CHECK(world_info(read).finished == world_info(read).wanted && !world_info(read).full);
    free(a);
    free(b);
    sr_world_destroy(read);
    sr_world_destroy(called);
}

/* points of a world with these settings; the caller frees them */
static float* generated_with(sr_context* context, sr_model* loaded, const sr_generation* generation, uint64_t* cells)
{
    const sr_cell_rect rect = {{0, -6}, {7, 6}};
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    float* points;
    desc.model = loaded;
    desc.generation = generation;
    CHECK_OK(context, sr_world_create(context, &desc, &world));
    walk(context, world, 1, 1);
    points = points_of(world, &rect, cells);
    sr_world_destroy(world);
    return points;
}

/* a model's own settings give what a world without settings has; each of them that is changed, something else */
static void settings_decide_the_points(sr_context* context)
{
    sr_model* loaded = load_model(context, model);
    sr_generation own = SR_INIT(sr_generation), changed[5], wrong;
    uint64_t cells = 0, others = 0;
    float *points = generated_with(context, loaded, NULL, &cells), *other;
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    size_t i;
    CHECK(sr_model_get_generation(NULL, &own) == SR_ERR_USAGE && says(NULL, "model is NULL"));
    CHECK_OK(context, sr_model_get_generation(loaded, &own));
    other = generated_with(context, loaded, &own, &others);
    CHECK(cells > 0 && others == cells && !memcmp(points, other, cells * 20 * 6 * sizeof(float)));
    free(other);
    for (i = 0; i < 5; ++i)
        changed[i] = own;
    changed[0].guidance_scale += 1;
    changed[1].sampler = SR_SAMPLER_DPMPP_2M;
    changed[2].region_size = 64;
    changed[3].guidance_from = 500;
    changed[4].sampler = SR_SAMPLER_DDIM;
    changed[4].eta = 0.5;
    for (i = 0; i < 5; ++i) {
        other = generated_with(context, loaded, &changed[i], &others);
        CHECK(others == cells && memcmp(points, other, cells * 20 * 6 * sizeof(float)) != 0);
        free(other);
    }
    free(points);
    desc.model = loaded;
    desc.generation = &wrong;
    wrong = own;
    wrong.sampler = 3;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_USAGE && says(context, "sampler is 3"));
    wrong = own;
    wrong.region_size = 0;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_USAGE && says(context, "region_size is 0"));
    wrong = own;
    wrong.guidance_scale = -1;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_USAGE && says(context, "guidance_scale is -1"));
    wrong = own;
    wrong.eta = 2;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_USAGE && says(context, "eta is 2") && !world);
    sr_model_destroy(loaded);
}

/* none, guessed and given objects; a file of them */
static void objects_condition_the_points(sr_context* context, const char* conditioned, const char* path)
{
    const sr_cell_rect rect = {{0, -6}, {7, 6}};
    sr_model* loaded = load_model(context, conditioned);
    sr_object house = {.label = 2, .center = {2, 4, 1.2}, .size = {9, 1.2, 2.4}, .color = {1, 0, 0}, .colored = 1};
    sr_object read[2];
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    float* points[3];
    uint64_t cells[3], count = 0;
    FILE* file;
    uint32_t i, k;
    desc.model = loaded;
    for (i = 0; i < 3; ++i) {
        desc.conditioning = i;
        desc.objects = i == SR_CONDITIONING_GIVEN ? &house : NULL;
        desc.object_count = i == SR_CONDITIONING_GIVEN;
        CHECK_OK(context, sr_world_create(context, &desc, &world));
        walk(context, world, 1, 1);
        points[i] = points_of(world, &rect, &cells[i]);
        sr_world_destroy(world);
    }
    for (k = 0; k < SR_CONDITIONING_GIVEN; ++k) /* of labels that have no objects none are guessed */
        CHECK(cells[k] == cells[2] && memcmp(points[k], points[2], cells[k] * 20 * 6 * sizeof(float)) != 0);
    for (i = 0; i < 3; ++i)
        free(points[i]);
    house.size[0] = -1;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_BAD_INPUT && says(context, "object 0"));
    house.size[0] = 9;
    house.color[1] = 2;
    CHECK(sr_world_create(context, &desc, &world) == SR_ERR_BAD_INPUT && says(context, "a colour of 2"));
    sr_model_destroy(loaded);
    house.color[1] = 0;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_BAD_INPUT && says(context, "object"));

    file = fopen(path, "w");
    CHECK(file);
    fputs("{\"format\": \"semrover.objects\", \"version\": 1, \"objects\": [", file);
    fputs("{\"id\": 7, \"class\": \"building\", \"center\": [1, 2, 3], \"size\": [4, 5, 6], \"heading\": 0.5, ", file);
    fputs("\"tint\": [1, 0.5, 0]}, ", file);
    fputs("{\"id\": 8, \"class\": \"road\", \"center\": [0, 0, 0], \"size\": [1, 1, 1], \"heading\": 0}]}", file);
    fclose(file);
    CHECK(sr_read_objects(path, NULL, &count) == SR_OK && count == 2);
    count = 1;
    CHECK(sr_read_objects(path, read, &count) == SR_ERR_PARTIAL && says(NULL, "2 objects") && count == 1);
    count = 2;
    CHECK(sr_read_objects(path, read, &count) == SR_OK && count == 2 && read[1].id == 8 && !read[1].colored);
    CHECK(read[0].id == 7 && read[0].label == 2 && read[0].center[2] == 3 && read[0].size[1] == 5);
    CHECK(read[0].heading == 0.5 && read[0].colored && read[0].color[1] == 0.5f && !read[0].part);
    CHECK(sr_read_objects("/nonesuch", NULL, &count) == SR_ERR_BAD_INPUT && says(NULL, "nonesuch"));
}

static uint64_t wanted_by(sr_context* context, sr_world* world, const sr_focus* foci, uint32_t count)
{
    uint32_t done = 0, steps = 0;
    CHECK_OK(context, sr_world_foci(world, foci, count));
    for (; !done; ++steps) {
        CHECK_OK(context, sr_world_step(world, 20000, &done));
        CHECK(steps < 10000);
    }
    CHECK(world_info(world).finished == world_info(world).wanted);
    return world_info(world).wanted;
}

/* two players far apart, a third one beside the first: what each of them has around, once, and nothing between */
static void several_foci_are_generated_at_once(sr_context* context)
{
    const sr_focus foci[3] = {{{2, 0, 1.5}, {1, 0, 0}, 2}, {{60, 0, 1.5}, {-1, 0, 0}, 3}, {{3, 0, 1.5}, {0, 0, 0}, 1}};
    const sr_cell_rect near_first = {{3, 0}, {3, 0}}, near_second = {{100, 0}, {100, 0}}, between = {{30, -6}, {70, 6}};
    const double behind[3] = {-20, 0, 0};
    sr_focus wrong[65];
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    uint64_t cells[3], all, generated, i;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    all = wanted_by(context, world, foci, 2);
    generated = world_info(world).generated;
    free(points_of(world, &near_first, &cells[0]));
    free(points_of(world, &near_second, &cells[1]));
    free(points_of(world, &between, &cells[2]));
    CHECK(cells[0] == 1 && cells[1] == 1 && cells[2] == 0);
    CHECK(all == wanted_by(context, world, foci, 1) + wanted_by(context, world, foci + 1, 1));
    CHECK(world_info(world).generated == generated);  /* they are there */
    CHECK(wanted_by(context, world, foci, 3) == all); /* of the same tiles as the first */
    CHECK_OK(context, sr_world_focus(world, behind, behind, 1));
    CHECK_OK(context, sr_world_foci(world, foci, 2)); /* the last call counts */
    CHECK_OK(context, sr_world_step(world, 0, NULL));
    CHECK(world_info(world).wanted == all);
    for (i = 0; i < 65; ++i)
        wrong[i] = foci[0];
    CHECK(sr_world_foci(world, wrong, 65) == SR_ERR_USAGE && says(context, "65 foci"));
    CHECK(sr_world_foci(world, wrong, 0) == SR_ERR_USAGE && says(context, "0 foci"));
    CHECK(sr_world_foci(world, NULL, 1) == SR_ERR_USAGE && says(context, "foci is NULL"));
    CHECK(sr_world_foci(NULL, foci, 1) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    wrong[63].direction[2] = NAN;
    CHECK(sr_world_foci(world, wrong, 64) == SR_ERR_USAGE && says(context, "finite"));
    wrong[63].direction[2] = 0;
    CHECK_OK(context, sr_world_foci(world, wrong, 64));
    sr_world_destroy(world);
}

static void an_edit_makes_its_place_anew(sr_context* context)
{
    const sr_cell_rect place = {{8, -6}, {15, 6}};
    const sr_cell wall = {10, 0, 1, 2}, wrong = {0, 0, 0, 77};
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    uint64_t cells = 0;
    uint32_t done = 0;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 6, 2);
    free(points_of(world, &place, &cells));
    CHECK(cells == 16 * 8);
    CHECK(sr_world_edit(world, &wrong, 1) == SR_ERR_BAD_INPUT && says(context, "label 77"));
    CHECK_OK(context, sr_world_edit(world, &wall, 1));
    free(points_of(world, &place, &cells));
    CHECK(cells < 16 * 8);
    while (!done)
        CHECK_OK(context, sr_world_step(world, 20000, &done));
    free(points_of(world, &place, &cells));
    CHECK(cells == 16 * 8 + 1);
    sr_world_destroy(world);
}

/* what was generated is shown again, with nothing loaded */
static void a_world_without_a_model_has_the_splats_of_its_grid(sr_context* context)
{
    const sr_cell_rect everywhere = {{-999, -999}, {999, 999}};
    sr_world_desc desc = street_world();
    sr_world *made = NULL, *shown = NULL;
    sr_grid* grid = NULL;
    CHECK_OK(context, create_world(context, model, &desc, &made));
    walk(context, made, 6, 2);
    CHECK_OK(context, sr_world_copy_cells(made, &everywhere, &grid));
    desc.model = NULL;
    desc.labels = NULL;
    desc.grid = grid;
    CHECK_OK(context, sr_world_create(context, &desc, &shown));
    sr_grid_destroy(grid);
    walk(context, shown, 6, 200);
    CHECK(world_info(shown).splats == world_info(made).splats && world_info(shown).splats > 5000);
    CHECK(world_info(shown).points_per_voxel == 20 && world_info(shown).generated == 0);
    sr_world_destroy(shown);
    sr_world_destroy(made);
}

static sr_draw_desc camera(void)
{
    sr_draw_desc draw;
    memset(&draw, 0, sizeof draw);
    draw.struct_size = sizeof draw;
    draw.width = WIDTH;
    draw.height = HEIGHT;
    draw.fx = draw.fy = WIDTH / 2;
    draw.cx = WIDTH / 2;
    draw.cy = HEIGHT / 2;
    look(1, draw.world_to_camera);
    return draw;
}

static float color[PIXELS * 4], normal[PIXELS * 4], depth[PIXELS * 2];
static uint32_t label[PIXELS * 2];

/* the road fills the lower half, and its depth is that of the plane */
static void looks_right(void)
{
    const int pixel = (HEIGHT - 6) * WIDTH + WIDTH / 2;
    const double a_metre_down = (WIDTH / 2) / (HEIGHT / 2 - 6 + 0.5); /* points lie up to 0.6 m above the ground */
    CHECK(color[4 * pixel + 3] > 0.5f);
    CHECK(depth[2 * pixel + 1] > 0.75 * a_metre_down && depth[2 * pixel + 1] < 1.65 * a_metre_down);
    CHECK(label[2 * pixel] == 0);
    CHECK(normal[4 * pixel + 3] > 0);
    CHECK(color[4 * (WIDTH / 2) + 3] == 0 && label[2 * (WIDTH / 2)] == SR_NO_CELL); /* the sky */
}

static void draws_into_host_memory(sr_context* context)
{
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    sr_draw_desc draw = camera();
    sr_splats splats;
    uint64_t version;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    memset(&splats, 0, sizeof splats);
    splats.struct_size = sizeof splats;
    CHECK_OK(context, sr_world_get_splats(world, &splats));
    version = splats.version;
    CHECK(splats.count == 0 && splats.positions.buffer);
    walk(context, world, 4, 6);
    CHECK_OK(context, sr_world_get_splats(world, &splats));
    CHECK(splats.count == 0 && splats.version == version); /* they are shown by draws, and by sr_world_record_updates */
    draw.color.memory = color;
    draw.normal.memory = normal;
    draw.depth.memory = depth;
    draw.label.memory = label;
    CHECK_OK(context, sr_world_draw(world, &draw));
    looks_right();
    CHECK_OK(context, sr_world_get_splats(world, &splats));
    CHECK(splats.count >= world_info(world).splats && splats.count % 64 == 0 && splats.version > version);
    CHECK(world_info(world).splats > 5000);
    CHECK(splats.positions.bytes / 16 == ((2u << 20) / 60 + 63) / 64 * 64 && splats.positions.bytes % 16 == 0);
    CHECK(splats.labels.bytes * 4 == splats.positions.bytes && splats.blocks.bytes * 64 == splats.labels.bytes);
    draw.fx = NAN;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_BAD_INPUT && says(context, "not finite"));
    draw = camera();
    draw.width = 0;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "0 x 40"));
    sr_world_destroy(world);
}

/* the same pictures through buffers and images of the application's own device */
static void draws_into_buffers_and_images_of_a_host(void)
{
    struct host host = make_host();
    sr_context* context = adopt_host(&host);
    sr_world_desc world_desc = street_world();
    sr_world* world = NULL;
    sr_draw_desc draw = camera();
    struct host_buffer buffer = make_buffer(&host, PIXELS * 16 + 64);
    struct host_image image = make_image(&host, WIDTH, HEIGHT, VK_FORMAT_R32G32B32A32_SFLOAT);
    CHECK_OK(context, create_world(context, model, &world_desc, &world));
    walk(context, world, 4, 6);
    draw.color.memory = color;
    draw.depth.memory = depth;
    draw.normal.memory = normal;
    draw.label.memory = label;
    draw.color.buffer = buffer.buffer;
    draw.color.buffer_offset = 64;
    draw.normal.image = image.image;
    draw.normal.layout_before = VK_IMAGE_LAYOUT_UNDEFINED;
    draw.normal.layout_after = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    CHECK_OK(context, sr_world_draw(world, &draw));
    looks_right();
    CHECK(!memcmp((char*)buffer.mapped + 64, color, sizeof color));
    CHECK(((char*)buffer.mapped)[63] == 0);
    read_image(&host, &image, &buffer); /* in the layout that was asked for */
    CHECK(!memcmp(buffer.mapped, normal, sizeof normal));
    sr_world_destroy(world);
    sr_context_destroy(context);
    destroy_image(&host, &image);
    destroy_buffer(&host, &buffer);
    CHECK(vkDeviceWaitIdle(host.device) == VK_SUCCESS);
    destroy_host(&host);
}

/* what a labels callback must not call: nothing happens but a status */
static struct {
    sr_context* context;
    sr_world* world;
    int calls;
} forbidden;

static sr_status calls_back(void* user, const sr_cell_rect* rect, sr_grid* grid)
{
    const sr_cell gone = {0, 0, 0, SR_NO_CELL};
    const double origin[3] = {0, 0, 0};
    sr_world_info info = SR_INIT(sr_world_info);
    sr_memory_info memory = SR_INIT(sr_memory_info);
    (void)user;
    ++forbidden.calls;
    CHECK(sr_world_edit(forbidden.world, &gone, 1) == SR_ERR_USAGE && says(NULL, "another call is at work"));
    CHECK(sr_world_step(forbidden.world, 0, NULL) == SR_ERR_USAGE);
    CHECK(sr_world_focus(forbidden.world, origin, origin, 1) == SR_ERR_USAGE);
    CHECK(sr_world_get_info(forbidden.world, &info) == SR_ERR_USAGE);
    CHECK(sr_context_get_memory(forbidden.context, &memory) == SR_ERR_USAGE);
    sr_world_destroy(forbidden.world);
    sr_context_destroy(forbidden.context);
    return labels(&calls, rect, grid);
}

/* of a picture of instances: how many pixels have the number, and the mean column and row of these */
static uint32_t seen_of(const uint32_t* instances, uint32_t number, double at[2])
{
    uint32_t i, count = 0;
    at[0] = at[1] = 0;
    for (i = 0; i < WIDTH * HEIGHT; ++i)
        if (instances[i] == number) {
            ++count;
            at[0] += i % WIDTH;
            at[1] += i / WIDTH;
        }
    at[0] /= count ? count : 1;
    at[1] /= count ? count : 1;
    return count;
}

/* the wall beside the road is an object: pictures have its number, and it stands elsewhere while it is an actor */
static void objects_are_seen_and_moved(sr_context* context)
{
    static uint32_t still[WIDTH * HEIGHT], moved[WIDTH * HEIGHT], again[WIDTH * HEIGHT];
    static float before[WIDTH * HEIGHT * 4], after[WIDTH * HEIGHT * 4];
    sr_object wall = {.id = 41, .label = 2, .center = {2, 3.9, 1.2}, .size = {40, 0.6, 2.4}};
    sr_actor_pose pose = {.pose = {1, 0, 0, 2, 0, 1, 0, 2.4, 0, 0, 1, 1.8}};
    sr_actor actors[2] = {{.object = 41, .pose_count = 1, .poses = &pose}};
    sr_world_desc desc = street_world();
    sr_draw_desc draw = camera_at(0, WIDTH, HEIGHT);
    sr_pick found = SR_INIT(sr_pick);
    sr_world* world = NULL;
    double at[2], then[2];
    uint32_t i, count;
    desc.conditioning = SR_CONDITIONING_GIVEN;
    desc.objects = &wall;
    desc.object_count = 1;
    CHECK_OK(context, create_world(context, conditioned, &desc, &world));
    walk(context, world, 4, 8);
    draw.color.memory = before;
    draw.instance.memory = still;
    CHECK_OK(context, sr_world_draw(world, &draw));
    count = seen_of(still, 42, at);
    CHECK(count > 20 && seen_of(still, 0, then) + count == WIDTH * HEIGHT);
    for (i = 0; still[i] != 42; ++i) {
    }
    CHECK_OK(context, sr_world_pick(world, &draw, i % WIDTH, i / WIDTH, &found));
    CHECK(found.instance == 42 && found.cell.label == 2);
    /* 1.5 m to the right, which is nearer, and 0.6 m up */
    CHECK_OK(context, sr_world_set_actors(world, actors, 1));
    draw.color.memory = after;
    draw.instance.memory = moved;
    CHECK_OK(context, sr_world_draw(world, &draw));
    CHECK(seen_of(moved, 42, then) > 20 && then[0] > at[0] + 1 && memcmp(before, after, sizeof before) != 0);
    CHECK_OK(context, sr_world_set_actors(world, NULL, 0));
    draw.color.memory = after;
    draw.instance.memory = again;
    CHECK_OK(context, sr_world_draw(world, &draw));
    CHECK(memcmp(before, after, sizeof before) == 0 && memcmp(still, again, sizeof still) == 0);
    /* what cannot be leaves all as it is */
    actors[1] = actors[0];
    CHECK(sr_world_set_actors(world, actors, 2) == SR_ERR_BAD_INPUT && says(context, "object 41 is an actor already"));
    actors[0].object = 7;
    CHECK(sr_world_set_actors(world, actors, 1) == SR_ERR_BAD_INPUT && says(context, "no object 7"));
    actors[0].object = 41;
    pose.pose[0] = 2;
    CHECK(sr_world_set_actors(world, actors, 1) == SR_ERR_BAD_INPUT && says(context, "actor 0"));
    CHECK(sr_world_set_actors(world, NULL, 1) == SR_ERR_USAGE && says(context, "actors is NULL"));
    CHECK(sr_world_set_actors(NULL, NULL, 0) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    CHECK_OK(context, sr_world_draw(world, &draw));
    CHECK(memcmp(still, again, sizeof still) == 0);
    sr_world_destroy(world);
}

static void calls_of_callbacks_are_refused(sr_context* context)
{
    sr_world_desc desc = street_world();
    desc.labels = calls_back;
    forbidden.context = context;
    CHECK_OK(context, create_world(context, model, &desc, &forbidden.world));
    walk(context, forbidden.world, 0, 1);
    CHECK(forbidden.calls > 0 && world_info(forbidden.world).splats > 0);
    sr_world_destroy(forbidden.world);
}

int main(int argc, char** argv)
{
    sr_context* context = NULL;
    CHECK(argc == 4);
    model = argv[1];
    sr_set_diagnostic_callback(print_line, stderr);
    edits_grids_cell_by_cell();
    grids_grow_in_pieces();
    CHECK(sr_context_create(NULL, &context) == SR_OK);
    refuses_wrong_worlds(context);
    labels_of_a_grid_and_of_a_callback_give_the_same_points(context);
    settings_decide_the_points(context);
    objects_condition_the_points(context, argv[2], argv[3]);
    conditioned = argv[2];
    objects_are_seen_and_moved(context);
    several_foci_are_generated_at_once(context);
    an_edit_makes_its_place_anew(context);
    a_world_without_a_model_has_the_splats_of_its_grid(context);
    draws_into_host_memory(context);
    calls_of_callbacks_are_refused(context);
    sr_context_destroy(context);
    draws_into_buffers_and_images_of_a_host();
    return 0;
}
