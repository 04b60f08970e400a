/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Pictures of a world's splats. semrover.h includes this header, and says what holds for all calls. struct VkBuffer_T*
 * is Vulkan's VkBuffer, and so on; formats and layouts are numbers of VkFormat and VkImageLayout.
 */
#ifndef SEMROVER_DRAW_H
#define SEMROVER_DRAW_H

#include "semrover.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where a picture goes: host memory, a buffer of the application's, or an image of its own, which has the picture's
 * size, one level and one layer, TRANSFER_DST usage, and belongs to the context's queue family. All may be NULL: then
 * the picture is not made. Memory and buffer get the format's texels row by row from the top, without padding. */
typedef struct sr_target {
    void* memory;
    struct VkBuffer_T* buffer; /* with TRANSFER_DST usage */
    uint64_t buffer_offset;
    struct VkImage_T* image;
    uint32_t layout_before; /* as it is; VK_IMAGE_LAYOUT_UNDEFINED is fine, all is written */
    uint32_t layout_after;  /* as it will be */
    uint32_t format;        /* one that the picture can have, see sr_draw_desc; 0: the first of them */
    uint32_t reserved;
} sr_target;

/* A z-buffer of the application's: splats behind it are not drawn. Metres along z are scale / (d - offset) for the
 * number d of a pixel. With 0 at the near plane n and 1 at the far plane f: scale = f n / (n - f), offset = f / (f -
 * n). Reversed, without a far plane (d = n / z): scale = n, offset = 0. */
typedef struct sr_depth_image {
    struct VkImage_T* image; /* of the picture's size, one level and one layer, TRANSFER_SRC usage, of the context's
                                queue family; NULL: no test */
    uint32_t format;         /* D32_SFLOAT or R32_SFLOAT */
    uint32_t layout_before;  /* not UNDEFINED */
    uint32_t layout_after;
    uint32_t reserved;
    double scale, offset;
} sr_depth_image;

/* A pinhole camera in OpenCV's convention: x right, y down, z forward; the centre of pixel (x, y) lies at
 * (x + 0.5, y + 0.5). What the pictures hold, and as which formats:
 * - color: r, g, b times alpha, alpha. The numbers are sRGB, as splats have them, or with color_linear light: alpha
 *   times the light of r, g, b, to be blended with light. R32G32B32A32_SFLOAT, R16G16B16A16_SFLOAT, R8G8B8A8_UNORM, or,
 *   without color_linear, R8G8B8A8_SRGB: its bytes are those of UNORM, as they are sRGB already. Who samples it gets
 *   light of r, g, b times alpha, which is right where alpha is 1.
 * - normal: sum of w normal in the camera's frame, towards it, w the weights of splats; sum of w depth.
 *   R32G32B32A32_SFLOAT, R16G16B16A16_SFLOAT, or R8G8B8A8_SNORM, whose fourth number is 0.
 * - depth: metres along z, mean and median of the splats; 0 where nothing is. R32G32_SFLOAT; the mean
 *   alone: R32_SFLOAT, R16_SFLOAT. With depth_scale these, and D32_SFLOAT, hold the number of a z-buffer, as
 *   sr_depth_image says, cut to 0..1: depth_scale / metres + depth_offset; depth_offset where nothing is. To an image
 *   of D32_SFLOAT only a queue family with graphics copies.
 * - label: of the splat with most weight, SR_NO_CELL for none; low bits of its voxel: 12 of i, 12 of j above them, then
 *   8 of k. The voxel is the nearest with these to where the depth says. R32G32_UINT; the label alone: R32_UINT, or
 *   R8_UINT with 255 for none.
 * - instance: number of the thing that the splat with most weight is of: the id + 1 of one of the world's objects or
 *   actors; 0 for none. R32_UINT.
 * Numbers of SFLOAT are rounded to the nearest, ties to even. UNORM has 255 v and SNORM 127 v of numbers that are cut
 * to 0..1 and -1..1, rounded to the nearest, halves away from 0. */
typedef struct sr_draw_desc {
    uint32_t struct_size;
    uint32_t width; /* pixels */
    const void* next;
    uint32_t height;
    uint32_t color_linear;      /* 1: light */
    double fx, fy, cx, cy;      /* pixels */
    double world_to_camera[12]; /* [3, 4] row by row: a rotation and metres */
    sr_target color, normal, depth, label;
    sr_depth_image depth_test;
    double depth_scale, depth_offset; /* 0, 0: metres. D32_SFLOAT needs a scale, R32G32_SFLOAT has none */
    sr_target instance;
} sr_draw_desc;

/* The render thread. Shows what is new, and draws what targets ask for. Waits for the device; for the compiler, the
 * first time with these formats. SR_ERR_USAGE: a world without splat_bytes, sizes that are not 1..16384, a format that
 * the picture cannot have; SR_ERR_BAD_INPUT: a camera that is not finite. */
SR_API sr_status sr_world_draw(sr_world* world, const sr_draw_desc* draw);

/* The same of several cameras: what is new is shown once, and cameras that follow each other with the same size,
 * formats and depth_scale, without depth_test, are drawn by one submit where the device has room. draws: `count` of
 * them, as far apart as the struct_size of the first says, which all have. The pictures are those of sr_world_draw, and
 * so are errors; SR_ERR_USAGE: a count of 0, too. After an error some of them may be drawn. */
SR_API sr_status sr_world_draws(sr_world* world, const sr_draw_desc* draws, uint32_t count);

/* A thing that moves: an object of the world (sr_world_desc.objects), whose splats are drawn somewhere else. */
typedef struct sr_actor {
    uint32_t object; /* its id, below 65535 */
    uint32_t reserved;
    double pose[12]; /* [3, 4] row by row, a rotation and metres: to the world from the object's own frame, which has x
                        along its heading, z up, and its origin in the middle of the box */
} sr_actor;

/* Where these objects are from the next draw on; others stand where the world has them. actors: `count` of them,
 * copied; 0: all stand. No splat is made anew. The render thread; does not wait. SR_ERR_USAGE: a world without
 * splat_bytes; SR_ERR_BAD_INPUT: an object that the world does not have, or twice, a pose that is no rotation; nothing
 * is changed then. */
SR_API sr_status sr_world_set_actors(sr_world* world, const sr_actor* actors, uint32_t count);

typedef struct sr_pick {
    uint32_t struct_size;
    uint32_t instance; /* number of the thing, as a picture of instances has it */
    sr_cell cell; /* voxel and class of the splat with most weight. Label SR_NO_CELL: there is none, all else is 0. A
                     splat that stands for several voxels (sr_world_desc.detail_distance) names one of them.
                     Where splats of several surfaces meet, it need not lie at `position` */
    double position[3]; /* metres, in the world's frame: the pixel's centre at its median depth */
    double alpha;       /* how much all splats cover the pixel, 0..1 */
} sr_pick;

/* What is under pixel (x, y) of a picture. Targets and depth_test are not looked at. Shows what is new, and draws the
 * pixel alone. The render thread. Waits and errors as sr_world_draw; SR_ERR_USAGE: a pixel outside, too. */
SR_API sr_status sr_world_pick(sr_world* world, const sr_draw_desc* draw, uint32_t x, uint32_t y, sr_pick* found);

#ifdef __cplusplus
}
#endif
#endif
