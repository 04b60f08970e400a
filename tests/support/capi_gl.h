/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Pictures of a street in GL's textures, and without GL, for tests in C. */
#ifndef SEMROVER_TESTS_CAPI_GL_H
#define SEMROVER_TESTS_CAPI_GL_H

#include "tests/support/capi_egl.h"
#include "tests/support/capi_street.h"

enum { WIDTH = 52, HEIGHT = 40, PIXELS = WIDTH * HEIGHT };

/* what sr_world_draw gives */
static float color[PIXELS * 4], normal[PIXELS * 4], depth[PIXELS * 2];
static uint32_t label[PIXELS * 2];

struct textures {
    struct texture color, normal, depth, label;
};

static struct textures make_textures(GLsizei width, GLsizei height)
{
    struct textures made;
    made.color = make_texture(width, height, GL_RGBA32F, GL_RGBA, GL_FLOAT);
    made.normal = make_texture(width, height, GL_RGBA32F, GL_RGBA, GL_FLOAT);
    made.depth = make_texture(width, height, GL_RG32F, GL_RG, GL_FLOAT);
    made.label = make_texture(width, height, GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT);
    return made;
}

static void delete_textures(const struct textures* t)
{
    const GLuint names[4] = {t->color.name, t->normal.name, t->depth.name, t->label.name};
    test_glDeleteTextures(4, names);
}

static sr_gl_draw_desc gl_camera(double x, const struct textures* t)
{
    sr_gl_draw_desc draw;
    memset(&draw, 0, sizeof draw);
    draw.struct_size = sizeof draw;
    draw.width = WIDTH;
    draw.height = HEIGHT;
    draw.fx = draw.fy = draw.cx = WIDTH / 2;
    draw.cy = HEIGHT / 2;
    look(x, draw.world_to_camera);
    draw.color = t->color.name;
    draw.normal = t->normal.name;
    draw.depth = t->depth.name;
    draw.label = t->label.name;
    return draw;
}

static void draw_without_gl(sr_context* context, sr_world* world, double x)
{
    sr_draw_desc draw = camera_at(x, WIDTH, HEIGHT);
    draw.color.memory = color;
    draw.normal.memory = normal;
    draw.depth.memory = depth;
    draw.label.memory = label;
    CHECK_OK(context, sr_world_draw(world, &draw));
    CHECK(color[4 * PIXELS - 1] > 0.5f && color[3] == 0); /* road below, sky above */
}

/* the textures have what draw_without_gl() gave, byte by byte */
static void check_textures(const struct textures* t)
{
    static float four[PIXELS * 4];
    static uint32_t words[PIXELS * 4];
    int i;
    read_texture(&t->color, four);
    CHECK(!memcmp(four, color, sizeof color));
    read_texture(&t->normal, four);
    CHECK(!memcmp(four, normal, sizeof normal));
    read_texture(&t->depth, four);
    for (i = 0; i < PIXELS; ++i)
        CHECK(!memcmp(four + 4 * i, depth + 2 * i, 8));
    read_texture(&t->label, words);
    for (i = 0; i < PIXELS; ++i)
        CHECK(!memcmp(words + 4 * i, label + 2 * i, 8));
}

static sr_gl* make_gl_with(sr_context* context, uint32_t best, sr_gl_function (*loader)(const char*))
{
    sr_gl_desc desc;
    sr_gl* gl = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.best = best;
    desc.get_proc_address = loader;
    CHECK_OK(context, sr_gl_create(context, &desc, &gl));
    CHECK(test_glGetError() == GL_NO_ERROR);
    return gl;
}

static sr_gl_info info_of(sr_gl* gl)
{
    sr_gl_info info;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK(sr_gl_get_info(gl, &info) == SR_OK);
    return info;
}

#endif
