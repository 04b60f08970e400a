/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Pictures in each format that they can have, to memory, buffers and images, against the whole numbers that are rounded
 * here in double; which formats are refused; and what one picture alone costs.
 *
 *     capi_pictures MODEL */
#include "tests/support/capi_memory.h"
#include "tests/support/capi_street.h"

#include <math.h>

enum { WIDTH = 63, HEIGHT = 41, PIXELS = WIDTH * HEIGHT }; /* an odd number of pixels: words end within pictures */

static const char* model;

/* as the library draws them, when nothing else is asked for */
static float color[PIXELS * 4], normal[PIXELS * 4], depth[PIXELS * 2];
static uint32_t label[PIXELS * 2];

static sr_world* make_world(sr_context* context)
{
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 4, 6);
    return world;
}

static uint8_t byte_of(double v, double most)
{
    v = round(most * fmax(-1, fmin(1, v))); /* halves away from 0 */
    return (uint8_t)(int)v;
}
static uint8_t unorm_of(double v)
{
    return byte_of(fmax(0, v), 255);
}

/* the nearest, ties to even */
static uint16_t half_of(double v)
{
    const uint16_t sign = v < 0 ? 0x8000 : 0;
    const double size = fabs(v);
    int exponent;
    double step, nearest;
    if (size >= 65520)
        return sign | 0x7c00;
    frexp(size, &exponent);
    step = ldexp(1, exponent < -13 ? -24 : exponent - 11);
    nearest = nearbyint(size / step) * step;
    if (nearest < ldexp(1, -14))
        return (uint16_t)(sign | (int)(nearest / ldexp(1, -24)));
    frexp(nearest, &exponent);
    return (uint16_t)(sign | (((exponent + 14) << 10) + (int)ldexp(nearest, 11 - exponent) - 1024));
}
static double half_value(uint16_t half)
{
    const int exponent = half >> 10 & 31, mantissa = half & 1023;
    const double size = exponent ? ldexp(1024 + mantissa, exponent - 25) : ldexp(mantissa, -24);
    return half >> 15 ? -size : size;
}

static void put_half(double v, uint8_t* to)
{
    const uint16_t half = half_of(v);
    memcpy(to, &half, sizeof half);
}

/* of pixel i, as a picture of this format has it */
static void expect(VkFormat format, int picture, int i, uint8_t* to)
{
    const float* four = picture == 0 ? color + 4 * i : normal + 4 * i;
    int c;
    for (c = 0; c < 4; ++c) {
        if (format == VK_FORMAT_R16G16B16A16_SFLOAT)
            put_half(four[c], to + 2 * c);
        else if (format == VK_FORMAT_R8G8B8A8_UNORM || format == VK_FORMAT_R8G8B8A8_SRGB)
            to[c] = unorm_of(four[c]);
        else if (format == VK_FORMAT_R8G8B8A8_SNORM)
            to[c] = c < 3 ? byte_of(four[c], 127) : 0;
    }
    if (format == VK_FORMAT_R32G32B32A32_SFLOAT)
        memcpy(to, four, 16);
    else if (format == VK_FORMAT_R32G32_SFLOAT)
        memcpy(to, depth + 2 * i, 8);
    else if (format == VK_FORMAT_R32_SFLOAT)
        memcpy(to, depth + 2 * i, 4);
    else if (format == VK_FORMAT_R16_SFLOAT)
        put_half(depth[2 * i], to);
    else if (format == VK_FORMAT_R32G32_UINT)
        memcpy(to, label + 2 * i, 8);
    else if (format == VK_FORMAT_R32_UINT)
        memcpy(to, label + 2 * i, 4);
    else if (format == VK_FORMAT_R8_UINT)
        to[0] = (uint8_t)(label[2 * i] == SR_NO_CELL ? 255 : label[2 * i]);
}

static const struct known_format {
    int picture; /* color, normal, depth, label */
    VkFormat format;
    int bytes; /* of a pixel */
} kFormats[] = {{0, VK_FORMAT_R32G32B32A32_SFLOAT, 16},
                {0, VK_FORMAT_R16G16B16A16_SFLOAT, 8},
                {0, VK_FORMAT_R8G8B8A8_UNORM, 4},
                {0, VK_FORMAT_R8G8B8A8_SRGB, 4},
                {1, VK_FORMAT_R32G32B32A32_SFLOAT, 16},
                {1, VK_FORMAT_R16G16B16A16_SFLOAT, 8},
                {1, VK_FORMAT_R8G8B8A8_SNORM, 4},
                {2, VK_FORMAT_R32G32_SFLOAT, 8},
                {2, VK_FORMAT_R32_SFLOAT, 4},
                {2, VK_FORMAT_R16_SFLOAT, 2},
                {3, VK_FORMAT_R32G32_UINT, 8},
                {3, VK_FORMAT_R32_UINT, 4},
                {3, VK_FORMAT_R8_UINT, 1}};
enum { FORMATS = sizeof kFormats / sizeof kFormats[0] };

static sr_target* target_of(sr_draw_desc* draw, int picture)
{
    sr_target* targets[4] = {&draw->color, &draw->normal, &draw->depth, &draw->label};
    return targets[picture];
}

static sr_draw_desc draw_of(VkFormat format, int picture)
{
    sr_draw_desc draw = camera_at(1, WIDTH, HEIGHT);
    target_of(&draw, picture)->format = format;
    return draw;
}

static void draw_whole_pictures(sr_context* context, sr_world* world)
{
    sr_draw_desc draw = camera_at(1, WIDTH, HEIGHT);
    int i, seen = 0, sky = 0;
    draw.color.memory = color;
    draw.normal.memory = normal;
    draw.depth.memory = depth;
    draw.label.memory = label;
    CHECK_OK(context, sr_world_draw(world, &draw));
    for (i = 0; i < PIXELS; ++i) {
        seen += color[4 * i + 3] > 0.5f && label[2 * i] < 20 && depth[2 * i] > 0;
        sky += color[4 * i + 3] == 0 && label[2 * i] == SR_NO_CELL && depth[2 * i] == 0;
    }
    CHECK(seen > PIXELS / 4 && sky > PIXELS / 8);
}

static void draws_each_format_into_memory(sr_context* context, sr_world* world)
{
    static uint8_t found[PIXELS * 16 + 1], expected[16];
    int f, i;
    for (f = 0; f < FORMATS; ++f) {
        const struct known_format* k = &kFormats[f];
        sr_draw_desc draw = draw_of(k->format, k->picture);
        target_of(&draw, k->picture)->memory = found;
        memset(found, 0xa5, sizeof found);
        CHECK_OK(context, sr_world_draw(world, &draw));
        for (i = 0; i < PIXELS; ++i) {
            expect(k->format, k->picture, i, expected);
            if (memcmp(found + i * k->bytes, expected, (size_t)k->bytes)) {
                fprintf(stderr, "format %d, picture %d, pixel %d\n", (int)k->format, k->picture, i);
                CHECK(0);
            }
        }
        CHECK(found[PIXELS * k->bytes] == 0xa5); /* tightly packed, and no byte more */
    }
}

/* recorded, to buffer and image at once: the bytes that memory gets */
static void records_each_format(const struct host* host, sr_context* context, sr_world* world)
{
    static uint8_t expected[PIXELS * 16];
    struct host_buffer buffer = make_buffer(host, sizeof expected + 9), read = make_buffer(host, sizeof expected);
    int f;
    for (f = 0; f < FORMATS; ++f) {
        const struct known_format* k = &kFormats[f];
        const size_t bytes = (size_t)k->bytes * PIXELS;
        struct host_image image = make_image(host, WIDTH, HEIGHT, k->format);
        const struct host_commands commands = begin_commands(host);
        sr_draw_desc draw = draw_of(k->format, k->picture);
        sr_target* target = target_of(&draw, k->picture);
        target->memory = expected;
        CHECK_OK(context, sr_world_draw(world, &draw));
        target->memory = NULL;
        target->buffer = buffer.buffer;
        target->buffer_offset = 8;
        target->image = image.image;
        target->layout_after = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
        memset(buffer.mapped, 0xa5, sizeof expected + 9);
        CHECK_OK(context, sr_world_record(world, &draw, commands.commands));
        CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
        run_commands(host, &commands);
        vkDestroyCommandPool(host->device, commands.pool, NULL);
        CHECK(!memcmp((char*)buffer.mapped + 8, expected, bytes));
        CHECK(((uint8_t*)buffer.mapped)[7] == 0xa5 && ((uint8_t*)buffer.mapped)[8 + bytes] == 0xa5);
        read_image(host, &image, &read);
        CHECK(!memcmp(read.mapped, expected, bytes));
        destroy_image(host, &image);
    }
    CHECK_OK(context, sr_world_check_draws(world));
    destroy_buffer(host, &buffer);
    destroy_buffer(host, &read);
}

/* of an sRGB number (IEC 61966-2-1) */
static double light_of(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}
static double linear_of(int i, int channel)
{
    const double alpha = color[4 * i + 3], v = color[4 * i + channel];
    return channel == 3 ? v : alpha > 0 ? alpha * light_of(v / alpha) : 0;
}

/* floats are a few units in the last place off; others at most where they round in another way for that */
static void draws_light(sr_context* context, sr_world* world)
{
    static float floats[PIXELS * 4];
    static uint16_t halves[PIXELS * 4];
    static uint8_t bytes[PIXELS * 4];
    sr_draw_desc draw = draw_of(VK_FORMAT_UNDEFINED, 0);
    int i;
    draw.color_linear = 1;
    draw.color.memory = floats;
    CHECK_OK(context, sr_world_draw(world, &draw));
    draw.color.format = VK_FORMAT_R16G16B16A16_SFLOAT;
    draw.color.memory = halves;
    CHECK_OK(context, sr_world_draw(world, &draw));
    draw.color.format = VK_FORMAT_R8G8B8A8_UNORM;
    draw.color.memory = bytes;
    CHECK_OK(context, sr_world_draw(world, &draw));
    for (i = 0; i < PIXELS * 4; ++i) {
        const double v = linear_of(i / 4, i % 4);
        CHECK(fabs(floats[i] - v) <= 1e-6 * v);
        CHECK(half_value(halves[i]) == half_value(half_of(floats[i])) && bytes[i] == unorm_of(floats[i]));
    }
    draw.color.format = VK_FORMAT_R8G8B8A8_SRGB;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "cannot be linear"));
    draw.color_linear = 2;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "color_linear is 2"));
}

/* near and far plane, and a reversed z-buffer; to memory and an image */
static void draws_z_buffers(const struct host* host, sr_context* context, sr_world* world)
{
    const double scales[2][2] = {{101. / (1 - 101), 101. / (101 - 1)}, {1, 0}};
    static float z[PIXELS];
    static uint16_t halves[PIXELS];
    struct host_buffer read = make_buffer(host, sizeof z);
    int s, i;
    for (s = 0; s < 2; ++s) {
        struct host_image image = make_image(host, WIDTH, HEIGHT, VK_FORMAT_D32_SFLOAT);
        sr_draw_desc draw = draw_of(VK_FORMAT_D32_SFLOAT, 2);
        draw.depth_scale = scales[s][0];
        draw.depth_offset = scales[s][1];
        draw.depth.memory = z;
        draw.depth.image = image.image;
        draw.depth.layout_after = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
        CHECK_OK(context, sr_world_draw(world, &draw));
        read_aspect(host, &image, VK_IMAGE_ASPECT_DEPTH_BIT, &read);
        CHECK(!memcmp(read.mapped, z, sizeof z));
        for (i = 0; i < PIXELS; ++i) {
            const double behind = depth[2 * i] > 0 ? (float)draw.depth_scale / (double)depth[2 * i] : 0;
            const double expected = fmax(0, fmin(1, behind + (float)draw.depth_offset));
            CHECK(fabs(z[i] - expected) <= 1.3e-7); /* one rounding below 2, and one of the quotient */
            if (depth[2 * i] == 0)
                CHECK(z[i] == (s == 0 ? 1 : 0)); /* infinitely far */
        }
        draw.depth.image = NULL;
        draw.depth.memory = halves;
        draw.depth.format = VK_FORMAT_R16_SFLOAT;
        CHECK_OK(context, sr_world_draw(world, &draw));
        for (i = 0; i < PIXELS; ++i)
            CHECK(halves[i] == half_of(z[i]));
        destroy_image(host, &image);
    }
    destroy_buffer(host, &read);
}

static void refuses_other_formats(sr_context* context, sr_world* world)
{
    static float some[PIXELS * 4];
    const VkFormat wrong[4] = {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_D16_UNORM,
                               VK_FORMAT_R32_SFLOAT};
    const char* lines[4] = {"color cannot have format 44", "normal cannot have format 37",
                            "depth cannot have format 124", "label cannot have format 100"};
    sr_draw_desc draw;
    int picture;
    for (picture = 0; picture < 4; ++picture) {
        draw = draw_of(wrong[picture], picture);
        target_of(&draw, picture)->memory = some;
        CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, lines[picture]));
        draw = draw_of(VK_FORMAT_UNDEFINED, picture);
        target_of(&draw, picture)->reserved = 1;
        CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "reserved of"));
    }
    draw = draw_of(VK_FORMAT_D32_SFLOAT, 2);
    draw.depth.memory = some;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "D32_SFLOAT without a depth_scale"));
    draw.depth_offset = 1;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "depth_offset is 1 without"));
    draw.depth_scale = INFINITY;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "not finite"));
    draw.depth_scale = 1;
    draw.depth.format = VK_FORMAT_R32G32_SFLOAT;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "has no depth_scale"));
}

/* device memory that the first draw of a world takes */
static uint64_t bytes_of_draw(sr_context* context, const sr_draw_desc* draw)
{
    sr_world* world = make_world(context);
    sr_memory_info before = SR_INIT(sr_memory_info), after = SR_INIT(sr_memory_info);
    CHECK_OK(context, sr_context_get_memory(context, &before));
    CHECK_OK(context, sr_world_draw(world, draw));
    CHECK_OK(context, sr_context_get_memory(context, &after));
    sr_world_destroy(world);
    return after.used_bytes - before.used_bytes;
}

/* what nobody asks for has no memory: three pictures of 16, 16 and 8 bytes a pixel, and 7 of each label */
static void makes_what_is_asked_for(sr_context* context)
{
    enum { LARGE = 16 * PIXELS };
    static float four[3][LARGE * 4];
    static uint32_t labels[LARGE * 2];
    static uint8_t bytes[LARGE];
    sr_draw_desc all = camera_at(1, 4 * WIDTH, 4 * HEIGHT), one = all;
    int i;
    all.color.memory = four[0];
    all.normal.memory = four[1];
    all.depth.memory = four[2];
    all.label.memory = labels;
    one.label.memory = bytes;
    one.label.format = VK_FORMAT_R8_UINT;
    CHECK(bytes_of_draw(context, &one) + 32 * LARGE < bytes_of_draw(context, &all));
    for (i = 0; i < LARGE; ++i)
        CHECK(bytes[i] == (labels[2 * i] == SR_NO_CELL ? 255 : labels[2 * i]));
}

/* three cameras alike, one of another size, one with other formats, and two tested against depth */
static void draws_several_cameras(const struct host* host, sr_context* context, sr_world* world)
{
    enum { CAMERAS = 7 };
    static float colors[2][CAMERAS][PIXELS * 4];
    static uint8_t labels[2][CAMERAS][PIXELS];
    const size_t bytes = sizeof colors[0][0];
    struct host_buffer buffer = make_buffer(host, CAMERAS * bytes);
    struct host_image image = make_image(host, WIDTH, HEIGHT, VK_FORMAT_D32_SFLOAT);
    sr_draw_desc draws[CAMERAS], far = draw_of(VK_FORMAT_D32_SFLOAT, 2);
    int all, i;
    far.depth_scale = 1; /* a z-buffer without a far plane, of this camera */
    far.depth.image = image.image;
    far.depth.layout_after = VK_IMAGE_LAYOUT_GENERAL;
    CHECK_OK(context, sr_world_draw(world, &far));
    for (all = 0; all < 2; ++all) {
        for (i = 0; i < CAMERAS; ++i) {
            draws[i] = camera_at(1 + 0.4 * i, i == 3 ? WIDTH - 5 : WIDTH, HEIGHT);
            draws[i].color.memory = colors[all][i];
            draws[i].label.memory = labels[all][i];
            draws[i].label.format = VK_FORMAT_R8_UINT;
            if (all) {
                draws[i].color.buffer = buffer.buffer;
                draws[i].color.buffer_offset = (size_t)i * bytes;
            }
        }
        draws[4].color.format = VK_FORMAT_R16G16B16A16_SFLOAT;
        for (i = 5; i < CAMERAS; ++i) {
            draws[i].depth_test.image = image.image;
            draws[i].depth_test.format = VK_FORMAT_D32_SFLOAT;
            draws[i].depth_test.layout_before = draws[i].depth_test.layout_after = VK_IMAGE_LAYOUT_GENERAL;
            draws[i].depth_test.scale = 1;
        }
        for (i = 0; !all && i < CAMERAS; ++i)
            CHECK_OK(context, sr_world_draw(world, &draws[i]));
    }
    CHECK_OK(context, sr_world_draws(world, draws, CAMERAS));
    CHECK(!memcmp(colors[0], colors[1], sizeof colors[0]) && !memcmp(labels[0], labels[1], sizeof labels[0]));
    for (i = 0; i < CAMERAS; ++i) {
        const size_t written = (size_t)draws[i].width * HEIGHT * (i == 4 ? 8 : 16);
        CHECK(!memcmp((char*)buffer.mapped + (size_t)i * bytes, colors[0][i], written));
        CHECK(i == 0 || memcmp(colors[0][i], colors[0][i - 1], bytes) != 0);
    }
    CHECK(sr_world_draws(world, draws, 0) == SR_ERR_USAGE && says(context, "count is 0"));
    CHECK(sr_world_draws(world, NULL, 1) == SR_ERR_USAGE && says(context, "NULL"));
    CHECK(sr_world_draws(NULL, draws, 1) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    draws[2].struct_size -= 8;
    CHECK(sr_world_draws(world, draws, CAMERAS) == SR_ERR_USAGE && says(context, "draw 2 has struct_size"));
    draws[2].struct_size += 8;
    draws[2].fx = NAN;
    CHECK(sr_world_draws(world, draws, CAMERAS) == SR_ERR_BAD_INPUT && says(context, "camera 2"));
    draws[2].height = 0;
    CHECK(sr_world_draws(world, draws, CAMERAS) == SR_ERR_USAGE && says(context, "63 x 0"));
    destroy_image(host, &image);
    destroy_buffer(host, &buffer);
}

static uint64_t used_after(sr_context* context, sr_world* world, uint32_t width)
{
    sr_memory_info memory = SR_INIT(sr_memory_info);
    sr_draw_desc draw = camera_at(1, width, HEIGHT);
    draw.color.memory = color;
    CHECK_OK(context, sr_world_draw(world, &draw));
    CHECK_OK(context, sr_context_get_memory(context, &memory));
    return memory.used_bytes;
}

/* pictures of two sizes in turn: what both need stays; of many sizes the last eight */
static void keeps_the_last_sizes(sr_context* context)
{
    sr_world* world = make_world(context);
    const uint64_t one = used_after(context, world, 40), both = used_after(context, world, 50);
    uint64_t eight = 0, all = 0;
    uint32_t width;
    CHECK(both > one);
    CHECK(used_after(context, world, 40) == both && used_after(context, world, 50) == both);
    for (width = 51; width < 57; ++width)
        eight = used_after(context, world, width);
    for (width = 57; width < 64; ++width)
        all = used_after(context, world, width);
    CHECK(eight > both && all < eight + (eight - both) / 3);
    sr_world_destroy(world);
}

static double distance_to(const sr_cell* cell, const double position[3])
{
    const int32_t low[3] = {cell->i, cell->j, cell->k};
    double square = 0;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        const double at = position[axis] / 0.6, away = fmax(fmax(low[axis] - at, at - low[axis] - 1), 0);
        square += away * away;
    }
    return 0.6 * sqrt(square);
}

/* how far the ray from `eye` through a place passes the voxel */
static double ray_distance_to(const sr_cell* cell, const double eye[3], const double position[3])
{
    double nearest = 1e9, at[3], t;
    int axis;
    for (t = 0.02; t < 20; t *= 1.005) {
        for (axis = 0; axis < 3; ++axis)
            at[axis] = eye[axis] + t * (position[axis] - eye[axis]);
        nearest = fmin(nearest, distance_to(cell, at));
    }
    return nearest;
}

/* some pixels: as whole pictures have it, a voxel of the world with that label, which the pixel's ray meets */
static void picks_voxels(sr_context* context, double x)
{
    static sr_cell cells[MOST_CELLS];
    const sr_cell_rect around = {{(int32_t)(x / 0.6) - 15, -9}, {(int32_t)(x / 0.6) + 40, 9}};
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    sr_grid* grid = NULL;
    sr_draw_desc draw = camera_at(x + 1, WIDTH, HEIGHT);
    sr_pick found = SR_INIT(sr_pick);
    uint64_t count = 0, c;
    double z;
    const double eye[3] = {x + 1, 0, 1.5};
    int i, picked = 0, none = 0;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, x + 4, 6);
    CHECK_OK(context, sr_world_copy_cells(world, &around, &grid));
    CHECK(sr_grid_get_cells(grid, 0, MOST_CELLS, cells, &count) == SR_OK && count > 100 && count < MOST_CELLS);
    sr_grid_destroy(grid);
    draw.color.memory = color;
    draw.depth.memory = depth;
    draw.label.memory = label;
    CHECK_OK(context, sr_world_draw(world, &draw));
    for (i = 3; i < PIXELS; i += 37) {
        CHECK_OK(context, sr_world_pick(world, &draw, (uint32_t)i % WIDTH, (uint32_t)i / WIDTH, &found));
        CHECK(found.cell.label == label[2 * i]);
        if (found.cell.label == SR_NO_CELL) {
            CHECK(found.alpha == 0 && found.position[0] == 0 && found.cell.i == 0);
            ++none;
            continue;
        }
        CHECK(label[2 * i + 1] ==
              (((uint32_t)found.cell.i & 4095) | ((uint32_t)found.cell.j & 4095) << 12 | (uint32_t)found.cell.k << 24));
        CHECK(fabs(found.alpha - color[4 * i + 3]) < 1e-3);
        z = found.position[0] - eye[0]; /* and the place lies on the ray */
        CHECK(fabs(z - depth[2 * i + 1]) < 1e-3);
        CHECK(fabs(draw.cx - draw.fx * found.position[1] / z - (i % WIDTH + 0.5)) < 1e-3);
        CHECK(fabs(draw.cy - draw.fy * (found.position[2] - eye[2]) / z - (i / WIDTH + 0.5)) < 1e-3);
        /* splats reach as far from their points on the surface, or on the screen as its filter does */
        CHECK(ray_distance_to(&found.cell, eye, found.position) < 0.6 + 2.4 * z / draw.fx);
        for (c = 0; c < count && memcmp(&cells[c], &found.cell, sizeof found.cell) != 0; ++c) {
        }
        CHECK(c < count);
        ++picked;
    }
    CHECK(picked > 25 && none > 5);
    CHECK(sr_world_pick(world, &draw, WIDTH, 0, &found) == SR_ERR_USAGE && says(context, "pixel 63, 0 of 63 x 41"));
    CHECK(sr_world_pick(world, &draw, 0, 0, NULL) == SR_ERR_USAGE && says(context, "found is NULL"));
    CHECK(sr_world_pick(NULL, &draw, 0, 0, &found) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    CHECK(sr_world_pick(world, NULL, 0, 0, &found) == SR_ERR_USAGE && says(context, "sr_draw_desc: NULL"));
    sr_world_destroy(world);
}

int main(int argc, char** argv)
{
    struct host host;
    sr_context* context;
    sr_world* world;
    CHECK(argc == 2);
    model = argv[1];
    sr_set_diagnostic_callback(print_line, stderr);
    host = make_host();
    context = adopt_host(&host);
    world = make_world(context);
    draw_whole_pictures(context, world);
    draws_each_format_into_memory(context, world);
    records_each_format(&host, context, world);
    draws_light(context, world);
    draws_z_buffers(&host, context, world);
    refuses_other_formats(context, world);
    draws_several_cameras(&host, context, world);
    sr_world_destroy(world);
    makes_what_is_asked_for(context);
    keeps_the_last_sizes(context);
    picks_voxels(context, 0);
    picks_voxels(context, -3000); /* beyond the bits that a splat has of its voxel */
    sr_context_destroy(context);
    CHECK(vkDeviceWaitIdle(host.device) == VK_SUCCESS);
    destroy_host(&host);
    return 0;
}
