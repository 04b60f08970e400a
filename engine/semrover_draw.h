/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What sensors see of a world's splats: pictures, optical flow, sweeps of lidars. semrover.h includes this header, and
 * says what holds for all calls. struct VkBuffer_T* is Vulkan's VkBuffer, and so on; formats and layouts are numbers of
 * VkFormat and VkImageLayout.
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

/* Camera models: the pixel of a ray (x, y, z) in the camera's axes, a = x / z, b = y / z, t its angle from z. Numbers
 * of sr_draw_desc.distortion in this order, the rest 0; formulas in docs/formats.md §7.2.
 * - PINHOLE: (fx a + cx, fy b + cy). None.
 * - OPENCV: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, as OpenCV has them. All 0: a pinhole.
 * - FISHEYE: k1 k2 k3 k4 of t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8), as OpenCV's.
 * - EQUIRECTANGULAR: none. The whole sphere: fx = width / (2 pi), fy = height / pi, cx = width / 2, cy = height / 2.
 * - FTHETA: p1 p2 p3 p4 p5 of the polynomial (whose number 0 is 0), c, d, e, the largest angle (radians), and 1 where
 *   the polynomial goes from pixels to angles, 0 where from angles to pixels; fx and fy are 1.
 * A depth is along z; of EQUIRECTANGULAR, and of FISHEYE and FTHETA that see more than 90 degrees from their axis in
 * the picture, from the camera. */
#define SR_CAMERA_PINHOLE 0u
#define SR_CAMERA_OPENCV 1u
#define SR_CAMERA_FISHEYE 2u
#define SR_CAMERA_EQUIRECTANGULAR 3u
#define SR_CAMERA_FTHETA 4u

/* Rolling shutters: which way the lines of a picture follow each other. DOWN reads the top row first, UP the bottom
 * row, RIGHT the left column, LEFT the right column. GLOBAL: all are seen at once. */
#define SR_SHUTTER_GLOBAL 0u
#define SR_SHUTTER_DOWN 1u
#define SR_SHUTTER_UP 2u
#define SR_SHUTTER_RIGHT 3u
#define SR_SHUTTER_LEFT 4u

/* A camera in OpenCV's convention: x right, y down, z forward; the centre of pixel (x, y) lies at (x + 0.5, y + 0.5).
 * What the pictures hold, and as which formats:
 * - color: r, g, b times alpha, alpha. The numbers are sRGB, as splats have them, or with color_linear light: alpha
 *   times the light of r, g, b, to be blended with light. R32G32B32A32_SFLOAT, R16G16B16A16_SFLOAT, R8G8B8A8_UNORM, or,
 *   without color_linear, R8G8B8A8_SRGB: its bytes are those of UNORM, as they are sRGB already. Who samples it gets
 *   light of r, g, b times alpha, which is right where alpha is 1.
 * - normal: sum of w normal in the camera's frame, towards it, w the weights of splats; sum of w depth.
 *   R32G32B32A32_SFLOAT, R16G16B16A16_SFLOAT, or R8G8B8A8_SNORM, whose fourth number is 0.
 * - depth: metres along z, or as the camera model says, mean and median of the splats; 0 where nothing is.
 *   R32G32_SFLOAT; the mean alone: R32_SFLOAT, R16_SFLOAT. With depth_scale these, and D32_SFLOAT, hold the number of a
 *   z-buffer, as sr_depth_image says, cut to 0..1: depth_scale / metres + depth_offset; depth_offset where nothing is.
 *   To an image of D32_SFLOAT only a queue family with graphics copies.
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
    sr_depth_image depth_test;        /* of a pinhole that stands, as does all that it sees, while it is read out */
    double depth_scale, depth_offset; /* 0, 0: metres. D32_SFLOAT needs a scale, R32G32_SFLOAT has none */
    sr_target instance;
    double time;           /* of the picture, seconds, within 1e12: where actors are (to the microsecond) */
    uint32_t camera_model; /* SR_CAMERA_.. */
    uint32_t shutter;      /* SR_SHUTTER_.., and if it is not GLOBAL: */
    double distortion[12];
    /* as world_to_camera, which is not looked at then: poses at the start and at the end of the readout. Between them
     * the position is linear and the rotation even about one axis. Line i of n, as they are read, is seen (i + 0.5) / n
     * of the readout after its start. Twice the same, to the bit: what a global shutter sees, but for actors */
    double world_to_camera_start[12], world_to_camera_end[12];
    double readout_start, readout_end; /* seconds from `time`; actors move meanwhile */
} sr_draw_desc;

/* The render thread. Shows what is new, and draws what targets ask for. Waits for the device; for the compiler, the
 * first time with these formats. SR_ERR_USAGE: a world without splat_bytes, sizes that are not 1..16384, a format that
 * the picture cannot have, no such camera model or shutter, times, a depth_test of what is no pinhole that stands;
 * SR_ERR_BAD_INPUT: a camera that is not finite, distortion that the model cannot have, poses of a readout that are no
 * rotation. */
SR_API sr_status sr_world_draw(sr_world* world, const sr_draw_desc* draw);

/* The same of several cameras: what is new is shown once, and cameras that follow each other with the same size,
 * formats, camera model and depth_scale, without depth_test, in all of which something moves during the readout or in
 * none, are drawn by one submit where the device has room. draws: `count` of them, as far apart as the struct_size of
 * the first says, which all have. The pictures are those of sr_world_draw, and so are errors; SR_ERR_USAGE: a count of
 * 0, too. After an error some of them may be drawn. */
SR_API sr_status sr_world_draws(sr_world* world, const sr_draw_desc* draws, uint32_t count);

typedef struct sr_actor_pose {
    int64_t time_us; /* microseconds, within 2^61 */
    double pose[12]; /* [3, 4] row by row, a rotation and metres: to the world from the object's own frame, which has x
                        along its heading, z up, and its origin in the middle of the box */
} sr_actor_pose;

/* A thing that moves: an object of the world (sr_world_desc.objects), whose splats are drawn somewhere else. Between
 * two poses the position is linear and the rotation even about one axis, the shorter way. It is there from its first
 * pose to its last, and nowhere at other times of pictures; with one pose it is there always. */
typedef struct sr_actor {
    uint32_t object; /* its id, below 65535 */
    uint32_t pose_count;
    const sr_actor_pose* poses; /* times ascend */
} sr_actor;

/* How these objects move, from the next draw on; others stand where the world has them. actors: `count` of them, which
 * are copied with their poses; 0: all stand. No splat is made anew. The render thread; does not wait. SR_ERR_USAGE: a
 * world without splat_bytes; SR_ERR_BAD_INPUT: an object that the world does not have, or twice, no pose, times that do
 * not ascend, a pose that is no rotation; nothing is changed then. */
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
 * pixel alone; where it is not of a pinhole that stands, the picture. The render thread. Waits and errors as
 * sr_world_draw; SR_ERR_USAGE: a pixel outside, too. */
SR_API sr_status sr_world_pick(sr_world* world, const sr_draw_desc* draw, uint32_t x, uint32_t y, sr_pick* found);

/* states of optical flow */
#define SR_FLOW_NOTHING 0u /* the pixel shows nothing */
#define SR_FLOW_SEEN 1u
#define SR_FLOW_HIDDEN 2u  /* something else is nearer then, or it is not there any more */
#define SR_FLOW_OUTSIDE 3u /* it leaves the picture */

/* Optical flow from one picture to another: where the surface that the centre of a pixel of `now` shows, at its median
 * depth, is in `next`. Cameras and actors move between the two times. Targets, depth_test and depth_scale of both are
 * not looked at. flow: R32G32_SFLOAT, pixels to the right and down; 1e10 twice where it is not known: nothing is there,
 * or the next lens cannot see it. states: R32_UINT, SR_FLOW_... At least one of them has a target; NULL: not wanted.
 * Shows what is new, and draws both. The render thread. Waits and errors as sr_world_draw; SR_ERR_USAGE: two sizes or
 * camera models, too. */
SR_API sr_status sr_world_flow(sr_world* world, const sr_draw_desc* now, const sr_draw_desc* next,
                               const sr_target* flow, const sr_target* states);

/* One turn of a spinning lidar, whose axes are x forward, y left, z up. */
typedef struct sr_sweep_desc {
    uint32_t struct_size;
    uint32_t reserved;
    const void* next;
    const char* lidar; /* the name of a table ("ot128") or a file that ends with ".json": docs/formats.md §7.5. It is
                          read once in the life of a world */
    /* [3, 4] row by row, a rotation and metres, when the sweep begins and when it ends. Each ray has the pose of its
     * moment: between them the position is linear and the rotation even about one axis */
    double sensor_to_world_begin[12], sensor_to_world_end[12];
    double time;        /* of the end, seconds, within 1e12; it began one turn of the table before. Actors move */
    double least_alpha; /* 0..1: a ray that splats cover less gives no return; 0: 0.5 */
} sr_sweep_desc;

typedef struct sr_lidar_return {
    float x, y, z;     /* metres, in the lidar's axes at the end of the sweep */
    float intensity;   /* 0..1, made of class and angle: docs/method.md §5.8 */
    uint32_t ring;     /* number of the beam, from the side that the table says */
    uint32_t label;    /* class */
    uint32_t instance; /* as a picture of instances has it */
    uint32_t time_us;  /* microseconds from the begin of the sweep */
} sr_lidar_return;

/* Returns of a sweep in the order in which they are fired, column by column, then from the top. returns NULL: *count
 * becomes the most that a sweep of this lidar can have, and nothing is drawn. Otherwise *count is the room in
 * `returns`, and becomes the number written; SR_ERR_PARTIAL: there are more. Shows what is new. The first sweep of a
 * lidar compiles it, and so does one when there are half as many splats again. The render thread. Waits for the device,
 * the compiler and the table's file. SR_ERR_USAGE: a world without splat_bytes, numbers out of range; SR_ERR_BAD_INPUT:
 * the table, and poses that are no rotation. */
SR_API sr_status sr_world_sweep(sr_world* world, const sr_sweep_desc* sweep, sr_lidar_return* returns, uint64_t* count);

#ifdef __cplusplus
}
#endif
#endif
