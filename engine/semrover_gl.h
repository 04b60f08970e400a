/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Worlds and renderers in an OpenGL or OpenGL ES context: pictures in textures of the application's, splats in buffer
 * objects. GL 3.1 or GLES 3.0. The library links neither GL nor EGL and includes no header of theirs: the application
 * gives a loader.
 *
 * Bytes come to GL in one of three ways, which sr_gl_get_info says. All of them give the
 * same bytes.
 * - SR_GL_SHARED: memory and semaphores of the device are imported by file descriptor. Nothing leaves the device, and
 *   each API waits for the other on the device. Needs VK_KHR_external_memory_fd, VK_KHR_external_semaphore_fd,
 *   GL_EXT_memory_object_fd, GL_EXT_semaphore_fd, and one driver with one device for both (their UUIDs).
 * - SR_GL_SHARED_MEMORY: without the two extensions for semaphores. The calling thread waits for GL, then for Vulkan.
 * - SR_GL_COPIES: pictures and splats are read back to host memory and uploaded. Works with any pair of drivers.
 * Sharing is asked for with sr_context_desc.share_by_fd or, on a device of the application's, with the last members of
 * sr_vulkan_device; without it, bytes are copied.
 *
 * Threads: the GL context for which an sr_gl was created, or one that shares its objects, is current on the thread that
 * calls. Otherwise an sr_gl is used as a world of its sr_context is. With several GL contexts that share objects, the
 * application orders their commands (fences, glFinish) as GL demands.
 *
 * State of GL: calls leave all of it as it was, but for texels of the textures that they are given. An error flag that
 * is set when a call begins is cleared, and the call fails with SR_ERR_USAGE; errors that a call raises it clears, too.
 *
 * Errors are remembered in the sr_context (sr_last_error). Every call blocks as is said at it.
 */
#ifndef SEMROVER_GL_H
#define SEMROVER_GL_H

#include "semrover.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sr_gl sr_gl; /* a GL context as this library knows it */

/* the better, the larger */
typedef enum sr_gl_way {
    SR_GL_BEST = 0, /* in sr_gl_desc: whichever is possible */
    SR_GL_COPIES = 1,
    SR_GL_SHARED_MEMORY = 2,
    SR_GL_SHARED = 3,
    SR_GL_WAY_IS_32_BIT = 0x7fffffff
} sr_gl_way;

typedef void (*sr_gl_function)(void);

typedef struct sr_gl_desc {
    uint32_t struct_size;
    uint32_t best; /* an sr_gl_way that is not exceeded; SR_GL_BEST: no limit */
    const void* next;
    /* Gives the function of a name ("glBindBuffer"), or NULL: eglGetProcAddress (EGL 1.5, or with
     * EGL_KHR_get_all_proc_addresses) and glfwGetProcAddress have this type. Called by sr_gl_create only. */
    sr_gl_function (*get_proc_address)(const char* name);
} sr_gl_desc;

/* Loads the functions and picks a way. Where drivers say that they can share memory, a few bytes are sent through it
 * first; if they do not arrive, bytes are copied. context: outlives the sr_gl, and is not destroyed before it. On
 * failure *gl is NULL. Blocks for the device and for GL (glFinish). SR_ERR_USAGE: a NULL, no GL context is current, one
 * that is too old, a function that the loader does not have. */
SR_API sr_status sr_gl_create(sr_context* context, const sr_gl_desc* desc, sr_gl** gl);

/* Deletes the library's GL objects; waits for GL (glFinish) and the device. NULL is fine. The GL context must still be
 * there, and current. */
SR_API void sr_gl_destroy(sr_gl* gl);

typedef struct sr_gl_info {
    uint32_t struct_size;
    sr_gl_way way;
    char reason[256];      /* why no better way was taken; empty for the best */
    uint32_t es;           /* 1: OpenGL ES */
    uint32_t major, minor; /* version of the GL context */
    uint32_t reserved;
    uint64_t shared_bytes; /* of device memory that both sides have now; sr_context_get_memory counts it, too */
    uint64_t copied_bytes; /* through host memory so far */
} sr_gl_info;

/* does not block */
SR_API sr_status sr_gl_get_info(sr_gl* gl, sr_gl_info* info);

/* The camera is a pinhole of sr_draw_desc. Textures are names of GL_TEXTURE_2D textures of the application's with width
 * x height texels at level 0; 0: not wanted. Their first row of texels (texture coordinate t = 0) is the top row of the
 * picture. What the pictures hold is said at sr_draw_desc. */
typedef struct sr_gl_draw_desc {
    uint32_t struct_size;
    uint32_t width; /* pixels */
    const void* next;
    uint32_t height;
    uint32_t unwaited;          /* 1: as sr_world_submit does, see below; 0: as sr_world_draw does */
    double fx, fy, cx, cy;      /* pixels */
    double world_to_camera[12]; /* [3, 4] row by row: a rotation and metres */
    uint32_t color;             /* GL_RGBA32F: r, g, b times alpha (sRGB), alpha */
    uint32_t normal;            /* GL_RGBA32F */
    uint32_t depth;             /* GL_RG32F: metres along z, mean and median of the splats; 0 where nothing is */
    uint32_t label;             /* GL_RG32UI: label, SR_NO_CELL for none; low bits of its voxel */
    double time;                /* as sr_draw_desc has it */
} sr_gl_draw_desc;

/* Draws the splats that are there into the textures. GL commands that the application issues from then on see the
 * pictures.
 *
 * Waits for the device until the splats are drawn; with SR_GL_SHARED_MEMORY also for GL, with SR_GL_COPIES until the
 * pixels are read back. The first draw of a size compiles it.
 * unwaited, with SR_GL_SHARED: waits for nothing. The device begins when it has finished the GL commands that were
 * issued before. A picture that there was too little room for lacks its farthest splats then: sr_world_check_draws says
 * so, and blocks for the draw. With the other ways unwaited changes nothing.
 *
 * SR_ERR_USAGE: as sr_world_draw, a world of another context, and what GL refuses: a texture that is too small or of
 * another kind of format. GLES 3.0 cannot be asked for more than that: a larger texture is filled in part, one of
 * halves is rounded. SR_ERR_BAD_INPUT: a camera that is not finite; SR_ERR_OUT_OF_MEMORY. */
SR_API sr_status sr_gl_draw(sr_gl* gl, sr_world* world, const sr_gl_draw_desc* draw);

/* The last finished frame of a renderer, as sr_renderer_take gives it, into a GL_TEXTURE_2D of the application's:
 * GL_RGBA8 or GL_SRGB8_ALPHA8, of the renderer's size. Blocks as sr_gl_draw does. */
SR_API sr_status sr_gl_take(sr_gl* gl, sr_renderer* renderer, uint32_t texture);

typedef struct sr_gl_array {
    uint32_t buffer; /* name of a buffer object of the library's, only to be read */
    uint32_t reserved;
    uint64_t bytes; /* of `count` elements; the buffer object may be larger */
} sr_gl_array;

/* Splat n has element n of each array; what they mean is said at sr_splats. */
typedef struct sr_gl_splats {
    uint32_t struct_size;
    uint32_t count;
    uint64_t version;
    sr_gl_array positions; /* 4 floats: x, y, z in metres, opacity */
    sr_gl_array normals;   /* 4 floats: unit normal, sigma along t_u in metres */
    sr_gl_array colors;    /* 4 floats: r, g, b (sRGB, 0..1), sigma along t_v in metres */
    sr_gl_array labels;    /* uint32 */
    sr_gl_array blocks;    /* uint32 for 64 splats, as sr_splats has them: 0 where no tile is, not to be looked at */
} sr_gl_splats;

/* Brings the buffer objects up to date: a copy of all splats on the device (with SR_GL_COPIES through host memory) when
 * the version has moved, nothing when it has not. They keep their bytes until the next call that copies: the world may
 * step meanwhile. They have room for all of the world's splat_bytes and are allocated by the first call; a world asked
 * for after another one takes its place, in buffer objects of other names. Blocks as sr_gl_draw does, except with
 * SR_GL_SHARED, when it waits for nothing. SR_ERR_USAGE: a world without splat_bytes or of another context;
 * SR_ERR_OUT_OF_MEMORY. */
SR_API sr_status sr_gl_get_splats(sr_gl* gl, sr_world* world, sr_gl_splats* splats);

#ifdef __cplusplus
}
#endif
#endif
