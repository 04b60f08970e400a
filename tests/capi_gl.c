/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C with a GL context: pictures in its textures and splats in buffer objects have the bytes that the library
 * gives without GL, in GL and GLES, by every way that the drivers here can go; GL's state stays as it was.
 *
 *     capi_gl MODEL RENDERER */
#include "tests/support/capi_gl.h"

static const char *model, *weights;

static sr_gl* make_gl(sr_context* context, uint32_t best)
{
    return make_gl_with(context, best, eglGetProcAddress);
}

static sr_gl_splats gl_splats(sr_context* context, sr_gl* gl, sr_world* world)
{
    sr_gl_splats splats;
    memset(&splats, 0, sizeof splats);
    splats.struct_size = sizeof splats;
    CHECK_OK(context, sr_gl_get_splats(gl, world, &splats));
    return splats;
}

/* The world's own buffers cannot be read from here; but what is drawn of them can: splats in front of a camera are
 * where its depth says. And numbers that any splat has. */
static void check_splats(sr_context* context, sr_gl* gl, sr_world* world)
{
    const sr_gl_splats splats = gl_splats(context, gl, world);
    sr_world_info info;
    float *positions, *normals, *colors;
    uint32_t *labels_found, *blocks, n, seen = 0, of_wall = 0;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK_OK(context, sr_world_get_info(world, &info));
    CHECK(splats.count >= info.splats && info.splats > 1000);
    CHECK(splats.positions.bytes == 16 * (uint64_t)splats.count && splats.labels.bytes == 4 * (uint64_t)splats.count);
    CHECK(splats.blocks.bytes * 64 == splats.labels.bytes);
    positions = malloc(splats.positions.bytes);
    normals = malloc(splats.normals.bytes);
    colors = malloc(splats.colors.bytes);
    labels_found = malloc(splats.labels.bytes);
    blocks = malloc(splats.blocks.bytes);
    read_buffer(splats.positions.buffer, splats.positions.bytes, positions);
    read_buffer(splats.normals.buffer, splats.normals.bytes, normals);
    read_buffer(splats.colors.buffer, splats.colors.bytes, colors);
    read_buffer(splats.labels.buffer, splats.labels.bytes, labels_found);
    read_buffer(splats.blocks.buffer, splats.blocks.bytes, blocks);
    for (n = 0; n < splats.count; ++n) {
        const float *p = positions + 4 * n, *v = normals + 4 * n, *c = colors + 4 * n;
        const float length = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        if (!blocks[n / 64] || p[3] == 0)
            continue; /* a place without a splat */
        ++seen;
        CHECK(p[1] > -4.2f && p[1] < 4.8f && p[2] > -0.1f && p[2] < 2.6f); /* of the street */
        CHECK(length > 0.99f && length < 1.01f && v[3] > 0 && c[3] > 0);
        CHECK(c[0] >= 0 && c[0] <= 1 && (labels_found[n] == 0 || labels_found[n] == 2));
        of_wall += labels_found[n] == 2;
    }
    CHECK(seen == info.splats && of_wall > 0 && of_wall < seen / 2);
    free(blocks);
    free(positions);
    free(normals);
    free(colors);
    free(labels_found);
}

/* state that calls use for themselves, set to what no call would leave */
static const GLenum kStates[] = {GL_UNPACK_ALIGNMENT,
                                 GL_UNPACK_ROW_LENGTH,
                                 GL_UNPACK_SKIP_ROWS,
                                 GL_UNPACK_SKIP_PIXELS,
                                 GL_PIXEL_UNPACK_BUFFER_BINDING,
                                 GL_TEXTURE_BINDING_2D,
                                 GL_COPY_READ_BUFFER_BINDING,
                                 GL_COPY_WRITE_BUFFER_BINDING,
                                 GL_ACTIVE_TEXTURE,
                                 GL_ARRAY_BUFFER_BINDING,
                                 GL_DRAW_FRAMEBUFFER_BINDING,
                                 GL_READ_FRAMEBUFFER_BINDING,
                                 GL_PIXEL_PACK_BUFFER_BINDING,
                                 GL_PACK_ALIGNMENT};
enum { STATES = sizeof kStates / sizeof *kStates };

struct strange {
    GLuint buffers[3];
    struct texture texture;
    GLint values[STATES];
};

static struct strange make_strange_state(void)
{
    struct strange s;
    int i;
    s.texture = make_texture(3, 5, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE);
    test_glGenBuffers(3, s.buffers);
    test_glBindBuffer(GL_PIXEL_UNPACK_BUFFER, s.buffers[0]);
    test_glBindBuffer(GL_COPY_READ_BUFFER, s.buffers[1]);
    test_glBindBuffer(GL_COPY_WRITE_BUFFER, s.buffers[2]);
    test_glBindTexture(GL_TEXTURE_2D, s.texture.name);
    test_glPixelStorei(GL_UNPACK_ALIGNMENT, 2);
    test_glPixelStorei(GL_UNPACK_ROW_LENGTH, 7);
    test_glPixelStorei(GL_UNPACK_SKIP_ROWS, 3);
    test_glPixelStorei(GL_UNPACK_SKIP_PIXELS, 5);
    for (i = 0; i < STATES; ++i)
        s.values[i] = integer_of(kStates[i]);
    CHECK(s.values[1] == 7 && s.values[4] == (GLint)s.buffers[0] && s.values[5] == (GLint)s.texture.name);
    return s;
}

static void check_strange_state(const struct strange* s)
{
    int i;
    CHECK(test_glGetError() == GL_NO_ERROR);
    for (i = 0; i < STATES; ++i)
        if (integer_of(kStates[i]) != s->values[i]) {
            fprintf(stderr, "GL state 0x%04x was %d and is %d\n", (unsigned)kStates[i], s->values[i],
                    integer_of(kStates[i]));
            exit(1);
        }
}

static void end_strange_state(const struct strange* s)
{
    test_glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
    test_glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    test_glPixelStorei(GL_UNPACK_SKIP_ROWS, 0);
    test_glPixelStorei(GL_UNPACK_SKIP_PIXELS, 0);
    test_glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    test_glBindBuffer(GL_COPY_READ_BUFFER, 0);
    test_glBindBuffer(GL_COPY_WRITE_BUFFER, 0);
    test_glBindTexture(GL_TEXTURE_2D, 0);
    test_glDeleteBuffers(3, s->buffers);
    test_glDeleteTextures(1, &s->texture.name);
}

/* draws of two cameras, waited for and not, between steps; in a strange state of GL */
static void draws(sr_context* context, sr_gl* gl, sr_world* world)
{
    const struct textures t = make_textures(WIDTH, HEIGHT), other = make_textures(WIDTH, HEIGHT);
    const struct strange strange = make_strange_state();
    int time;
    for (time = 0; time < 4; ++time) {
        sr_gl_draw_desc draw = gl_camera(1 + time, &t);
        draw.unwaited = time % 2;
        CHECK_OK(context, sr_gl_draw(gl, world, &draw));
        check_strange_state(&strange);
        if (time == 1) { /* another one before anybody has looked at the first */
            draw = gl_camera(3, &other);
            draw.unwaited = 1;
            CHECK_OK(context, sr_gl_draw(gl, world, &draw));
            draw_without_gl(context, world, 3);
            check_textures(&other);
        }
        CHECK_OK(context, sr_world_step(world, 0, NULL));
        draw_without_gl(context, world, 1 + time);
        check_textures(&t);
        CHECK_OK(context, sr_world_check_draws(world));
    }
    check_splats(context, gl, world);
    check_strange_state(&strange);
    end_strange_state(&strange);
    delete_textures(&t);
    delete_textures(&other);
}

/* what is not wanted is left alone, and a larger picture may follow a smaller one */
static void draws_what_is_wanted(sr_context* context, sr_gl* gl, sr_world* world)
{
    const struct textures t = make_textures(WIDTH, HEIGHT);
    const struct texture large = make_texture(2 * WIDTH, 2 * HEIGHT, GL_RGBA32F, GL_RGBA, GL_FLOAT);
    static float four[4 * PIXELS * 4];
    sr_gl_draw_desc draw = gl_camera(1, &t);
    int i;
    CHECK_OK(context, sr_gl_draw(gl, world, &draw));
    draw_without_gl(context, world, 1);
    draw = gl_camera(3, &t);
    draw.color = draw.normal = draw.label = 0;
    CHECK_OK(context, sr_gl_draw(gl, world, &draw));
    read_texture(&t.color, four);
    CHECK(!memcmp(four, color, sizeof color)); /* of the camera before */
    draw_without_gl(context, world, 3);
    read_texture(&t.depth, four);
    for (i = 0; i < PIXELS; ++i)
        CHECK(!memcmp(four + 4 * i, depth + 2 * i, 8));
    draw = gl_camera(1, &t);
    draw.normal = draw.depth = draw.label = 0;
    draw.color = large.name;
    draw.width *= 2;
    draw.height *= 2;
    draw.fx = draw.fy = draw.cx = WIDTH;
    draw.cy = HEIGHT;
    CHECK_OK(context, sr_gl_draw(gl, world, &draw));
    read_texture(&large, four);
    CHECK(four[4 * 4 * PIXELS - 1] > 0.5f && four[3] == 0);
    test_glDeleteTextures(1, &large.name);
    delete_textures(&t);
}

static void refuses_wrong_draws(sr_context* context, sr_gl* gl, sr_world* world)
{
    const struct textures t = make_textures(WIDTH, HEIGHT);
    const struct texture small = make_texture(WIDTH - 1, HEIGHT, GL_RGBA32F, GL_RGBA, GL_FLOAT);
    sr_world_desc bare = street_world();
    sr_world* without = NULL;
    sr_gl_draw_desc draw = gl_camera(1, &t);
    sr_gl_splats splats;
    sr_gl_info info;
    const struct strange strange = make_strange_state();
    CHECK(sr_gl_draw(NULL, world, &draw) == SR_ERR_USAGE && says(NULL, "gl is NULL"));
    CHECK(sr_gl_draw(gl, NULL, &draw) == SR_ERR_USAGE && says(context, "world is NULL"));
    CHECK(sr_gl_draw(gl, world, NULL) == SR_ERR_USAGE && says(context, "sr_gl_draw_desc: NULL"));
    draw.struct_size = 0;
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_USAGE && says(context, "struct_size"));
    draw = gl_camera(1, &t);
    draw.unwaited = 2;
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_USAGE && says(context, "unwaited is 2"));
    draw = gl_camera(1, &t);
    draw.fx = 0;
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_BAD_INPUT && says(context, "focal length"));
    draw = gl_camera(1, &t);
    draw.color = small.name;
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_USAGE && says(context, "GL error 0x0501: uploading color"));
    draw = gl_camera(1, &t);
    draw.label = t.color.name;
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_USAGE && says(context, "uploading label"));
    draw = gl_camera(1, &t);
    test_glEnable(GL_TEXTURE_BINDING_2D);
    CHECK(sr_gl_draw(gl, world, &draw) == SR_ERR_USAGE && says(context, "GL error 0x0500: was set before sr_gl_draw"));
    CHECK_OK(context, sr_gl_draw(gl, world, &draw));
    check_strange_state(&strange);
    end_strange_state(&strange);
    bare.splat_bytes = 0;
    CHECK_OK(context, create_world(context, model, &bare, &without));
    memset(&splats, 0, sizeof splats);
    CHECK(sr_gl_draw(gl, without, &draw) == SR_ERR_USAGE && says(context, "without splat_bytes"));
    CHECK(sr_gl_get_splats(gl, without, &splats) == SR_ERR_USAGE && says(context, "without splat_bytes"));
    CHECK(sr_gl_get_splats(gl, world, &splats) == SR_ERR_USAGE && says(context, "struct_size"));
    CHECK(sr_gl_get_splats(gl, NULL, &splats) == SR_ERR_USAGE && says(context, "world is NULL"));
    CHECK(sr_gl_get_splats(NULL, world, &splats) == SR_ERR_USAGE && says(NULL, "gl is NULL"));
    memset(&info, 0, sizeof info);
    CHECK(sr_gl_get_info(gl, &info) == SR_ERR_USAGE && says(context, "struct_size"));
    CHECK(sr_gl_take(gl, NULL, 1) == SR_ERR_USAGE && says(context, "renderer is NULL"));
    sr_world_destroy(without);
    test_glDeleteTextures(1, &small.name);
    delete_textures(&t);
}

/* splats follow the world: they change when it does, and another world takes the place */
static void splats_follow_the_world(sr_context* context, sr_gl* gl, sr_world* world)
{
    sr_world_desc desc = street_world();
    const sr_cell gone = {4, 0, 0, SR_NO_CELL};
    const sr_gl_splats first = gl_splats(context, gl, world);
    sr_gl_splats splats = gl_splats(context, gl, world);
    sr_world* second = NULL;
    uint32_t done = 0;
    CHECK(splats.version == first.version && splats.positions.buffer == first.positions.buffer);
    CHECK_OK(context, sr_world_edit(world, &gone, 1));
    while (!done)
        CHECK_OK(context, sr_world_step(world, 20000, &done));
    splats = gl_splats(context, gl, world);
    CHECK(splats.version > first.version && splats.positions.buffer == first.positions.buffer);
    check_splats(context, gl, world);
    CHECK_OK(context, create_world(context, model, &desc, &second));
    splats = gl_splats(context, gl, second);
    CHECK(splats.count == 0);
    walk(context, second, 2, 2);
    check_splats(context, gl, second);
    check_splats(context, gl, world);
    sr_world_destroy(second);
}

/* frames of a renderer, in a texture */
static void takes_frames(sr_context* context, sr_gl* gl, sr_world* world)
{
    static uint8_t expected[PIXELS * 4], found[PIXELS * 4];
    const struct texture t = make_texture(WIDTH, HEIGHT, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE);
    sr_renderer_desc desc;
    sr_frame_desc frame;
    sr_target target;
    sr_renderer* renderer = NULL;
    uint32_t done = 0;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.steps = 1;
    desc.noise = SR_NOISE_FRESH;
    memset(&frame, 0, sizeof frame);
    frame.struct_size = sizeof frame;
    frame.world = world;
    frame.fx = frame.fy = frame.cx = WIDTH / 2;
    frame.cy = HEIGHT / 2;
    look(1, frame.world_to_camera);
    memset(&target, 0, sizeof target);
    target.memory = expected;
    CHECK_OK(context, create_renderer(context, weights, &desc, &renderer));
    CHECK(sr_gl_take(gl, renderer, t.name) == SR_ERR_USAGE && says(context, "no frame is finished"));
    CHECK_OK(context, sr_renderer_begin(renderer, &frame));
    while (!done)
        CHECK_OK(context, sr_renderer_step(renderer, 0, &done));
    CHECK(sr_gl_take(gl, renderer, 0) == SR_ERR_USAGE && says(context, "texture is 0"));
    CHECK_OK(context, sr_gl_take(gl, renderer, t.name));
    CHECK_OK(context, sr_renderer_take(renderer, &target));
    read_texture(&t, found);
    CHECK(!memcmp(found, expected, sizeof found) && found[3] == 255);
    sr_renderer_destroy(renderer);
    test_glDeleteTextures(1, &t.name);
}

static sr_gl_function no_function(const char* name)
{
    return strcmp(name, "glGetString") ? NULL : eglGetProcAddress(name);
}

static void refuses_wrong_contexts(sr_context* context)
{
    sr_gl_desc desc;
    sr_gl* gl = (sr_gl*)&desc;
    memset(&desc, 0, sizeof desc);
    desc.get_proc_address = eglGetProcAddress;
    CHECK(sr_gl_create(NULL, &desc, &gl) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_gl_create(context, NULL, &gl) == SR_ERR_USAGE && says(context, "NULL") && !gl);
    CHECK(sr_gl_create(context, &desc, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    CHECK(sr_gl_create(context, &desc, &gl) == SR_ERR_USAGE && says(context, "struct_size"));
    desc.struct_size = sizeof desc;
    desc.best = 4;
    CHECK(sr_gl_create(context, &desc, &gl) == SR_ERR_USAGE && says(context, "best is 4"));
    desc.best = SR_GL_BEST;
    desc.get_proc_address = NULL;
    CHECK(sr_gl_create(context, &desc, &gl) == SR_ERR_USAGE && says(context, "get_proc_address is NULL"));
    desc.get_proc_address = no_function;
    CHECK(sr_gl_create(context, &desc, &gl) == SR_ERR_USAGE && says(context, "does not have gl") && !gl);
    sr_gl_destroy(NULL);
}

static void needs_a_current_context(sr_context* context)
{
    sr_gl_desc desc;
    sr_gl* gl = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.get_proc_address = eglGetProcAddress;
    CHECK(sr_gl_create(context, &desc, &gl) == SR_ERR_USAGE && says(context, "no GL context is current") && !gl);
}

/* all of it in one context of GL, by one way; which way it was */
static sr_gl_way runs(sr_context* context, sr_world* world, uint32_t best, int all)
{
    sr_gl* gl = make_gl(context, best);
    const sr_gl_info info = info_of(gl);
    printf("GL%s %u.%u, way %d%s%s\n", info.es ? "ES" : "", (unsigned)info.major, (unsigned)info.minor, (int)info.way,
           info.reason[0] ? ": " : "", info.reason);
    fflush(stdout);
    CHECK(info.major >= 3 && (info.way == SR_GL_SHARED) == !info.reason[0]);
    CHECK(best == SR_GL_BEST || info.way <= (sr_gl_way)best);
    draws(context, gl, world);
    if (all) { /* what does not depend on the kind of GL */
        draws_what_is_wanted(context, gl, world);
        refuses_wrong_draws(context, gl, world);
        splats_follow_the_world(context, gl, world);
        takes_frames(context, gl, world);
    }
    CHECK((info_of(gl).copied_bytes == 0) == (info.way != SR_GL_COPIES));
    CHECK((info_of(gl).shared_bytes == 0) == (info.way == SR_GL_COPIES));
    sr_gl_destroy(gl);
    CHECK(test_glGetError() == GL_NO_ERROR);
    return info.way;
}

/* what is used of the device comes back */
static uint64_t used_bytes(sr_context* context)
{
    sr_memory_info memory;
    memset(&memory, 0, sizeof memory);
    memory.struct_size = sizeof memory;
    CHECK(sr_context_get_memory(context, &memory) == SR_OK);
    return memory.used_bytes;
}

static sr_context* make_sharing_context(void)
{
    sr_context_desc desc;
    sr_context* context = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.share_by_fd = 2;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "share_by_fd"));
    desc.share_by_fd = 1;
    CHECK_OK(NULL, sr_context_create(&desc, &context));
    return context;
}

/* a context that was not told to share copies; so does one on the application's device that has nothing enabled */
static void copies_where_nobody_asked_to_share(void)
{
    struct host host = make_host();
    const sr_vulkan_device vulkan = lent(&host);
    sr_context_desc desc;
    int lent_device;
    for (lent_device = 0; lent_device < 2; ++lent_device) {
        sr_context* context = NULL;
        sr_gl* gl;
        memset(&desc, 0, sizeof desc);
        desc.struct_size = sizeof desc;
        desc.vulkan = lent_device ? &vulkan : NULL;
        CHECK_OK(NULL, sr_context_create(&desc, &context));
        gl = make_gl(context, SR_GL_BEST);
        CHECK(info_of(gl).way == SR_GL_COPIES && strstr(info_of(gl).reason, "share_by_fd"));
        sr_gl_destroy(gl);
        sr_context_destroy(context);
    }
    destroy_host(&host);
}

/* Mesa's two drivers of CPUs share memory with each other */
static int shares_for_sure(sr_context* context)
{
    const char* gl_name = (const char*)((PFNGLGETSTRINGPROC)eglGetProcAddress("glGetString"))(GL_RENDERER);
    sr_device_info device;
    memset(&device, 0, sizeof device);
    device.struct_size = sizeof device;
    CHECK_OK(context, sr_context_get_device(context, &device));
    return strstr(gl_name, "llvmpipe") && strstr(device.name, "llvmpipe");
}

int main(int argc, char** argv)
{
    const struct {
        EGLenum api;
        EGLint major, minor;
    } kinds[2] = {{EGL_OPENGL_ES_API, 3, 0}, {EGL_OPENGL_API, 3, 3}};
    int gone[SR_GL_SHARED + 1] = {0};
    sr_context* context;
    sr_world_desc desc;
    sr_world* world = NULL;
    sr_gl_way way;
    uint64_t before;
    int i;
    CHECK(argc == 3);
    model = argv[1];
    weights = argv[2];
    sr_set_diagnostic_callback(print_line, stderr);
    context = make_sharing_context();
    needs_a_current_context(context);
    desc = street_world();
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 4, 4);
    for (i = 0; i < 2; ++i) {
        const struct egl egl = make_egl(kinds[i].api, kinds[i].major, kinds[i].minor);
        load_gl();
        refuses_wrong_contexts(context);
        gone[runs(context, world, SR_GL_COPIES, i == 0)] = 1;
        way = runs(context, world, SR_GL_BEST, i == 0);
        before = used_bytes(context); /* with pictures that the context keeps for the way */
        CHECK(runs(context, world, SR_GL_BEST, 0) == way && used_bytes(context) == before);
        gone[way] = 1;
        CHECK(way >= SR_GL_SHARED_MEMORY || !shares_for_sure(context));
        if (way == SR_GL_SHARED)
            gone[runs(context, world, SR_GL_SHARED_MEMORY, 0)] = 1;
        if (i == 0)
            copies_where_nobody_asked_to_share();
        destroy_egl(&egl);
    }
    CHECK(gone[SR_GL_COPIES]);
    sr_world_destroy(world);
    sr_context_destroy(context);
    return 0;
}
