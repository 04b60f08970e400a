/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C that refines frames of a world: drawn by the library, or as buffers of its own; and what it may get
 * wrong. The frames are those of `semrover refine` for the same buffers.
 *
 *     capi_refine MODEL RENDERER RENDERER_OF_VIDEOS SEMROVER FOLDER */
#include "tests/support/capi_memory.h"
#include "tests/support/capi_png.h"
#include "tests/support/capi_street.h"

#include <math.h>

enum { WIDTH = 52, HEIGHT = 40, PIXELS = WIDTH * HEIGHT, FRAMES = 3, STEPS = 3, SEED = 5 };

static const char *model, *weights, *video, *program, *folder;

/* the buffers of a drive, in the form that files and renderers have them; and frames, four bytes a pixel */
static uint8_t seen[FRAMES][PIXELS * 4], expected[FRAMES][PIXELS * 4];
static uint16_t depth[FRAMES][PIXELS];

static double place_of(int frame)
{
    return 1 + 0.5 * frame;
}

static sr_renderer_desc description(uint32_t noise)
{
    sr_renderer_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.steps = STEPS;
    desc.seed = SEED;
    desc.noise = noise;
    return desc;
}

static sr_frame_desc camera_of(int frame)
{
    sr_frame_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.fx = desc.fy = desc.cx = WIDTH / 2;
    desc.cy = HEIGHT / 2;
    look(place_of(frame), desc.world_to_camera);
    return desc;
}

static sr_frame_desc buffers_of(int frame)
{
    sr_frame_desc desc = camera_of(frame);
    desc.seen.memory = seen[frame];
    desc.depth.memory = depth[frame];
    return desc;
}

static sr_renderer_info info_of(sr_renderer* renderer)
{
    sr_renderer_info info;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK(sr_renderer_get_info(renderer, &info) == SR_OK);
    return info;
}

static sr_renderer* make_renderer(sr_context* context, uint32_t noise)
{
    sr_renderer_desc desc = description(noise);
    sr_renderer* renderer = NULL;
    CHECK_OK(context, create_renderer(context, weights, &desc, &renderer));
    return renderer;
}

/* steps a frame that has begun to its end; how many it took */
static uint32_t finish(sr_context* context, sr_renderer* renderer, uint64_t budget)
{
    uint32_t done = 0, steps = 0;
    for (; !done; ++steps)
        CHECK_OK(context, sr_renderer_step(renderer, budget, &done));
    return steps;
}

static void check_frame(sr_context* context, sr_renderer* renderer, int frame)
{
    static uint8_t found[PIXELS * 4];
    sr_target target;
    memset(&target, 0, sizeof target);
    target.memory = found;
    CHECK_OK(context, sr_renderer_take(renderer, &target));
    CHECK(!memcmp(found, expected[frame], sizeof found));
    target.format = VK_FORMAT_R8G8B8A8_SRGB; /* the same bytes */
    memset(found, 0, sizeof found);
    CHECK_OK(context, sr_renderer_take(renderer, &target));
    CHECK(!memcmp(found, expected[frame], sizeof found));
    target.format = VK_FORMAT_R32G32B32A32_SFLOAT;
    CHECK(sr_renderer_take(renderer, &target) == SR_ERR_USAGE && says(context, "format 109"));
}

/* 0..1 as files have it, and metres */
static uint8_t byte_of(float value)
{
    return (uint8_t)lroundf(fminf(fmaxf(value, 0), 1) * 255);
}
static uint16_t millimetres_of(float metres)
{
    return (uint16_t)lroundf(fminf(fmaxf(metres * 1000, 0), 65535));
}

/* draws the drive through sr_world_draw, as an application would that has its own idea of what a buffer is */
static void draw_buffers(sr_context* context, sr_world* world)
{
    static float color[PIXELS * 4], metres[PIXELS * 2];
    uint32_t covered = 0;
    int f, i, c;
    for (f = 0; f < FRAMES; ++f) {
        const sr_frame_desc camera = camera_of(f);
        sr_draw_desc draw;
        memset(&draw, 0, sizeof draw);
        draw.struct_size = sizeof draw;
        draw.width = WIDTH;
        draw.height = HEIGHT;
        draw.fx = camera.fx;
        draw.fy = camera.fy;
        draw.cx = camera.cx;
        draw.cy = camera.cy;
        memcpy(draw.world_to_camera, camera.world_to_camera, sizeof draw.world_to_camera);
        draw.color.memory = color;
        draw.depth.memory = metres;
        CHECK_OK(context, sr_world_draw(world, &draw));
        for (i = 0; i < PIXELS; ++i) {
            for (c = 0; c < 3; ++c)
                seen[f][4 * i + c] = byte_of(color[4 * i + c]);
            seen[f][4 * i + 3] = color[4 * i + 3] >= 0.5f ? 255 : 0;
            depth[f][i] = millimetres_of(metres[2 * i]);
            covered += seen[f][4 * i + 3] != 0;
        }
    }
    CHECK(covered > FRAMES * PIXELS / 4 && covered < FRAMES * PIXELS);
}

static void run(const char* command)
{
    printf("%s\n", command);
    fflush(stdout);
    CHECK(system(command) == 0);
}

static void write_buffers(void)
{
    static uint8_t color[PIXELS * 3], visible[PIXELS];
    char name[1024];
    FILE* path;
    int f, i, c;
    snprintf(name, sizeof name, "rm -rf %s/in && mkdir -p %s/in/color %s/in/visible %s/in/depth", folder, folder,
             folder, folder);
    run(name);
    snprintf(name, sizeof name, "%s/path.tum", folder);
    path = fopen(name, "w");
    CHECK(path);
    for (f = 0; f < FRAMES; ++f) {
        for (i = 0; i < PIXELS; ++i) {
            for (c = 0; c < 3; ++c)
                color[3 * i + c] = seen[f][4 * i + c];
            visible[i] = seen[f][4 * i + 3];
        }
        snprintf(name, sizeof name, "%s/in/color/%06d.png", folder, f);
        write_png(name, WIDTH, HEIGHT, PNG_COLOR_TYPE_RGB, 8, color);
        snprintf(name, sizeof name, "%s/in/visible/%06d.png", folder, f);
        write_png(name, WIDTH, HEIGHT, PNG_COLOR_TYPE_GRAY, 8, visible);
        snprintf(name, sizeof name, "%s/in/depth/%06d.png", folder, f);
        write_png(name, WIDTH, HEIGHT, PNG_COLOR_TYPE_GRAY, 16, depth[f]);
        fprintf(path, "%d %g 0 1.5 -0.5 0.5 -0.5 0.5\n", f, place_of(f));
    }
    CHECK(fclose(path) == 0);
}

/* what the program makes of the buffers becomes what is expected */
static void refine_by_the_program(const char* noise)
{
    static uint8_t frame[PIXELS * 3];
    char text[2048];
    int f, i, c;
    snprintf(
        text, sizeof text,
        "%s refine %s/in -m %s -o %s/out -y --quiet --path %s/path.tum -W %d -H %d --fov-x 90 --steps %d --seed %d "
        "--frame-noise %s",
        program, folder, weights, folder, folder, WIDTH, HEIGHT, STEPS, SEED, noise);
    run(text);
    for (f = 0; f < FRAMES; ++f) {
        snprintf(text, sizeof text, "%s/out/frames/%06d.png", folder, f);
        read_png(text, WIDTH, HEIGHT, frame);
        for (i = 0; i < PIXELS; ++i) {
            for (c = 0; c < 3; ++c)
                expected[f][4 * i + c] = frame[3 * i + c];
            expected[f][4 * i + 3] = 255;
        }
    }
    CHECK(memcmp(expected[0], expected[1], sizeof expected[0]) != 0);
}

static void refuses_wrong_renderers(sr_context* context)
{
    sr_renderer_desc desc = description(SR_NOISE_FRESH);
    sr_renderer* renderer = (sr_renderer*)&desc;
    CHECK(sr_renderer_create(context, NULL, &renderer) == SR_ERR_USAGE && says(context, "NULL") && !renderer);
    CHECK(sr_renderer_create(NULL, &desc, &renderer) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_renderer_create(context, &desc, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    desc.struct_size = 0;
    CHECK(sr_renderer_create(context, &desc, &renderer) == SR_ERR_USAGE && says(context, "struct_size"));
    desc = description(SR_NOISE_FRESH);
    desc.next = &desc;
    CHECK(sr_renderer_create(context, &desc, &renderer) == SR_ERR_USAGE && says(context, "next is not NULL"));
    desc = description(3);
    CHECK(create_renderer(context, weights, &desc, &renderer) == SR_ERR_USAGE && says(context, "noise is 3"));
    desc = description(SR_NOISE_FRESH);
    desc.width = 0;
    CHECK(sr_renderer_create(context, &desc, &renderer) == SR_ERR_USAGE && says(context, "0 x 40"));
    desc = description(SR_NOISE_FRESH);
    desc.reserved = 2;
    CHECK(create_renderer(context, weights, &desc, &renderer) == SR_ERR_USAGE && says(context, "reserved"));
    desc = description(SR_NOISE_FRESH);
    desc.camera = "../up";
    CHECK(create_renderer(context, weights, &desc, &renderer) == SR_ERR_USAGE && says(context, "camera's name"));
    desc = description(SR_NOISE_FRESH);
    CHECK(sr_renderer_create(context, &desc, &renderer) == SR_ERR_USAGE && says(context, "model is NULL"));
    CHECK(create_renderer(context, model, &desc, &renderer) == SR_ERR_USAGE &&
          says(context, "the model has no renderer"));
    CHECK(create_renderer(context, video, &desc, &renderer) == SR_ERR_USAGE && says(context, "windows of them") &&
          !renderer);
}

static void refuses_wrong_frames(sr_context* context, sr_world* world)
{
    sr_renderer* renderer = make_renderer(context, SR_NOISE_ON_SURFACES);
    sr_frame_desc frame = buffers_of(0);
    sr_world_desc bare = street_world();
    sr_world* without = NULL;
    sr_renderer_info info;
    sr_target target;
    uint32_t done = 0;
    memset(&target, 0, sizeof target);
    CHECK(sr_renderer_begin(NULL, &frame) == SR_ERR_USAGE && says(NULL, "renderer is NULL"));
    CHECK(sr_renderer_begin(renderer, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    frame.struct_size = 2;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "struct_size"));
    frame = buffers_of(0);
    frame.reserved = 1;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "reserved"));
    frame = camera_of(0);
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "seen: one of memory and buffer"));
    frame.seen.memory = seen[0];
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "depth: one of memory and buffer"));
    frame = buffers_of(0);
    frame.world = world;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "one of world and seen"));
    frame = buffers_of(0);
    frame.fx = NAN;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_BAD_INPUT && says(context, "focal lengths"));
    frame = buffers_of(0);
    frame.world_to_camera[3] = INFINITY;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_BAD_INPUT && says(context, "not finite"));
    bare.splat_bytes = 0;
    CHECK_OK(context, create_world(context, model, &bare, &without));
    frame = camera_of(0);
    frame.world = without;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "without splat_bytes"));
    sr_world_destroy(without);
    CHECK(sr_renderer_step(renderer, 0, &done) == SR_ERR_USAGE && says(context, "no frame has begun"));
    CHECK(sr_renderer_take(renderer, &target) == SR_ERR_USAGE && says(context, "no frame is finished"));
    CHECK(sr_renderer_take(renderer, NULL) == SR_ERR_USAGE && says(context, "target is NULL"));
    frame = buffers_of(0);
    CHECK_OK(context, sr_renderer_begin(renderer, &frame));
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(context, "a frame is at work"));
    CHECK(sr_renderer_restart(renderer) == SR_ERR_USAGE && says(context, "a frame is at work"));
    CHECK(info_of(renderer).busy == 1);
    memset(&info, 0, sizeof info);
    CHECK(sr_renderer_get_info(renderer, &info) == SR_ERR_USAGE && says(context, "struct_size"));
    CHECK_OK(context, sr_renderer_cancel(renderer));
    CHECK(info_of(renderer).busy == 0 && info_of(renderer).frames == 0);
    CHECK(sr_renderer_step(NULL, 0, NULL) == SR_ERR_USAGE && sr_renderer_take(NULL, &target) == SR_ERR_USAGE);
    CHECK(sr_renderer_cancel(NULL) == SR_ERR_USAGE && sr_renderer_restart(NULL) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_renderer_get_info(NULL, &info) == SR_ERR_USAGE);
    sr_renderer_destroy(renderer);
    sr_renderer_destroy(NULL);
}

/* a world of another context is not this renderer's */
static void refuses_worlds_of_other_contexts(sr_context* context, sr_world* world)
{
    sr_context* other = NULL;
    sr_renderer* renderer;
    sr_frame_desc frame = camera_of(0);
    (void)context;
    CHECK(sr_context_create(NULL, &other) == SR_OK);
    renderer = make_renderer(other, SR_NOISE_FRESH);
    frame.world = world;
    CHECK(sr_renderer_begin(renderer, &frame) == SR_ERR_USAGE && says(other, "another context"));
    sr_renderer_destroy(renderer);
    sr_context_destroy(other);
}

/* pieces of a frame: the encoder, three steps, the decoder; the bytes do not depend on the budget */
static void refines_what_the_world_shows(sr_context* context, sr_world* world, uint32_t noise)
{
    sr_renderer* renderer = make_renderer(context, noise);
    const sr_renderer_info info = info_of(renderer);
    int f;
    CHECK(info.steps == STEPS && info.noise == noise && info.resident == 1 && info.visible_alpha == 0.5f);
    for (f = 0; f < FRAMES; ++f) {
        sr_frame_desc frame = camera_of(f);
        frame.world = world;
        CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        if (f == 1)
            CHECK(finish(context, renderer, 3600000000u) == 1);
        else
            CHECK(finish(context, renderer, 0) == STEPS + 2);
        check_frame(context, renderer, f);
    }
    CHECK(info_of(renderer).frames == FRAMES);
    sr_renderer_destroy(renderer);
}

static void refines_buffers_of_the_host(sr_context* context, uint32_t noise)
{
    sr_renderer* renderer = make_renderer(context, noise);
    int f;
    for (f = 0; f < FRAMES; ++f) {
        sr_frame_desc frame = buffers_of(f);
        if (noise == SR_NOISE_FRESH)
            memset(&frame.depth, 0, sizeof frame.depth); /* nobody reads it */
        CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        finish(context, renderer, 20000);
        check_frame(context, renderer, f);
    }
    sr_renderer_destroy(renderer);
}

/* a frame that is given up, wherever it was, leaves nothing behind */
static void begins_again_after_a_cancel(sr_context* context)
{
    sr_renderer* renderer = make_renderer(context, SR_NOISE_ON_SURFACES);
    uint32_t pieces, piece;
    int f;
    for (f = 0; f < FRAMES; ++f) {
        const sr_frame_desc frame = buffers_of(f), other = buffers_of(FRAMES - 1 - f);
        for (pieces = 0; pieces < STEPS + 2; ++pieces) {
            CHECK_OK(context, sr_renderer_begin(renderer, &other));
            for (piece = 0; piece < pieces; ++piece)
                CHECK_OK(context, sr_renderer_step(renderer, 0, NULL));
            CHECK_OK(context, sr_renderer_cancel(renderer));
        }
        CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        finish(context, renderer, 20000);
        check_frame(context, renderer, f);
    }
    CHECK_OK(context, sr_renderer_cancel(renderer)); /* there is none */
    CHECK_OK(context, sr_renderer_restart(renderer));
    CHECK(info_of(renderer).frames == 0);
    for (f = 0; f < 2; ++f) {
        const sr_frame_desc frame = buffers_of(f);
        CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        finish(context, renderer, 20000);
        check_frame(context, renderer, f);
    }
    sr_renderer_destroy(renderer);
}

/* where both networks do not fit at a time, they take turns; where neither does, that is said */
static void keeps_to_a_budget_of_memory(uint64_t resident_bytes)
{
    sr_context_desc desc;
    sr_context* context = NULL;
    sr_renderer* renderer;
    sr_renderer_desc wanted = description(SR_NOISE_ON_SURFACES);
    sr_memory_info memory;
    int f;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.max_bytes = resident_bytes - 1;
    CHECK(sr_context_create(&desc, &context) == SR_OK);
    renderer = make_renderer(context, SR_NOISE_ON_SURFACES);
    CHECK(info_of(renderer).resident == 0 && info_of(renderer).device_bytes < resident_bytes);
    for (f = 0; f < FRAMES; ++f) {
        const sr_frame_desc frame = buffers_of(f);
        CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        CHECK_OK(context, sr_renderer_step(renderer, 0, NULL));
        CHECK_OK(context, sr_renderer_step(renderer, 0, NULL));
        if (f == 1) { /* in the middle of it */
            CHECK_OK(context, sr_renderer_cancel(renderer));
            CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        }
        finish(context, renderer, 0);
        check_frame(context, renderer, f);
    }
    memset(&memory, 0, sizeof memory);
    memory.struct_size = sizeof memory;
    CHECK_OK(context, sr_context_get_memory(context, &memory));
    CHECK(memory.used_bytes <= info_of(renderer).device_bytes);
    CHECK(memory.peak_bytes <= desc.max_bytes); /* of the model, which fitted as long as nothing rendered */
    sr_renderer_destroy(renderer);
    sr_context_destroy(context);
    desc.max_bytes = 100000;
    CHECK(sr_context_create(&desc, &context) == SR_OK);
    CHECK(create_renderer(context, weights, &wanted, &renderer) == SR_ERR_OUT_OF_MEMORY &&
          says(context, "bytes staged") && !renderer);
    sr_context_destroy(context);
}

/* buffers and images of the application's own device, in and out */
static void trades_with_a_host_on_the_device(void)
{
    struct host host = make_host();
    sr_context* context = adopt_host(&host);
    struct host_buffer in = make_buffer(&host, PIXELS * 6 + 16), out = make_buffer(&host, PIXELS * 4 + 8);
    struct host_image image = make_image(&host, WIDTH, HEIGHT, VK_FORMAT_R8G8B8A8_UNORM);
    sr_renderer* renderer = make_renderer(context, SR_NOISE_ON_SURFACES);
    int f;
    for (f = 0; f < FRAMES; ++f) {
        sr_frame_desc frame = camera_of(f);
        sr_target target;
        memcpy((char*)in.mapped + 16, seen[f], PIXELS * 4);
        memcpy((char*)in.mapped + 16 + PIXELS * 4, depth[f], PIXELS * 2);
        frame.seen.buffer = frame.depth.buffer = in.buffer;
        frame.seen.buffer_offset = 16;
        frame.depth.buffer_offset = 16 + PIXELS * 4;
        CHECK_OK(context, sr_renderer_begin(renderer, &frame));
        memset(in.mapped, 0, PIXELS * 6 + 16); /* it is copied */
        finish(context, renderer, 20000);
        memset(&target, 0, sizeof target);
        target.buffer = out.buffer;
        target.buffer_offset = 8;
        target.image = image.image;
        target.layout_before = VK_IMAGE_LAYOUT_UNDEFINED;
        target.layout_after = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
        CHECK_OK(context, sr_renderer_take(renderer, &target));
        CHECK(!memcmp((char*)out.mapped + 8, expected[f], sizeof expected[f]));
        read_image(&host, &image, &out);
        CHECK(!memcmp(out.mapped, expected[f], sizeof expected[f]));
    }
    sr_renderer_destroy(renderer);
    sr_context_destroy(context);
    destroy_image(&host, &image);
    destroy_buffer(&host, &in);
    destroy_buffer(&host, &out);
    destroy_host(&host);
}

static uint64_t resident_bytes(sr_context* context)
{
    sr_renderer* renderer = make_renderer(context, SR_NOISE_ON_SURFACES);
    const uint64_t bytes = info_of(renderer).device_bytes;
    sr_renderer_destroy(renderer);
    return bytes;
}

int main(int argc, char** argv)
{
    sr_context *context = NULL, *bare = NULL;
    sr_world_desc desc;
    sr_world* world = NULL;
    CHECK(argc == 6);
    model = argv[1];
    weights = argv[2];
    video = argv[3];
    program = argv[4];
    folder = argv[5];
    sr_set_diagnostic_callback(print_line, stderr);
    CHECK(sr_context_create(NULL, &context) == SR_OK);
    refuses_wrong_renderers(context);
    desc = street_world();
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 4, 6);
    draw_buffers(context, world);
    write_buffers();
    refuses_wrong_frames(context, world);
    refuses_worlds_of_other_contexts(context, world);
    refine_by_the_program("fresh");
    refines_what_the_world_shows(context, world, SR_NOISE_FRESH);
    refines_buffers_of_the_host(context, SR_NOISE_FRESH);
    refine_by_the_program("warped");
    refines_what_the_world_shows(context, world, SR_NOISE_ON_SURFACES);
    sr_world_destroy(world);
    refines_buffers_of_the_host(context, SR_NOISE_ON_SURFACES);
    begins_again_after_a_cancel(context);
    sr_context_destroy(context);
    CHECK(sr_context_create(NULL, &bare) == SR_OK);
    keeps_to_a_budget_of_memory(resident_bytes(bare));
    sr_context_destroy(bare);
    trades_with_a_host_on_the_device();
    return 0;
}
