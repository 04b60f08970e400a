/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Renderers: frames of one camera, each made by a deferred renderer from its splat buffer and the frame before.
 * semrover.h includes this header, and says what holds for all calls.
 */
#ifndef SEMROVER_RENDERER_H
#define SEMROVER_RENDERER_H

#include "semrover.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sr_renderer sr_renderer;

/* where noise comes from (docs/method.md, section 6.2) */
#define SR_NOISE_OF_MODEL 0u    /* one of the two below */
#define SR_NOISE_FRESH 1u       /* each frame has its own, and holds nothing of the frame before (section 6.5) */
#define SR_NOISE_ON_SURFACES 2u /* it stays on what both frames show, which flickers less: needs depth and camera */

/* The frames have the bytes that `semrover refine` gives for the same buffers, model, seed, steps, noise and name of
 * the camera, on the same device and driver; budgets do not change them. */
typedef struct sr_renderer_desc {
    uint32_t struct_size;
    uint32_t steps; /* of denoising a frame; 0: as the model says */
    const void* next;
    const sr_model* model;  /* of the same context, with a renderer of single frames */
    uint32_t width, height; /* of the frames, pixels, 1..16384 */
    uint64_t seed;
    const char* camera; /* NULL: the only one. Cameras of a rig have a renderer each, and their noise differs by name */
    uint32_t noise;     /* SR_NOISE_.. */
    uint32_t reserved;
    void (*message)(void* user, const char* line); /* warnings, during sr_renderer_create; NULL: none */
    void* user;                                    /* for the callback */
} sr_renderer_desc;

/* Waits for the compiler and the device. Compiles the model's networks. Where sr_context_desc.max_bytes has no room for
 * all that they need, they are loaded in turn for every frame, to the same bytes. context: outlives the renderer, and
 * is not destroyed before it. On failure *renderer is NULL. SR_ERR_USAGE: a NULL, a size, a model without a renderer of
 * frames; SR_ERR_BAD_INPUT: the model's files; SR_ERR_OUT_OF_MEMORY: with what it would take. */
SR_API sr_status sr_renderer_create(sr_context* context, const sr_renderer_desc* desc, sr_renderer** renderer);
SR_API void sr_renderer_destroy(sr_renderer* renderer); /* gives up a frame that is at work; NULL is fine */

/* Host memory, or a buffer of the application's that belongs to the context's queue family. One of the two. */
typedef struct sr_source {
    const void* memory;
    struct VkBuffer_T* buffer; /* with TRANSFER_SRC usage */
    uint64_t buffer_offset;
} sr_source;

/* What the next frame is made of: splats of a world, drawn here without leaving the device, or buffers of the
 * application's. Row by row from the top, without padding. The camera is a pinhole of sr_draw_desc; it is needed for a
 * world, and for noise on surfaces. */
typedef struct sr_frame_desc {
    uint32_t struct_size;
    uint32_t reserved;
    const void* next;
    sr_world* world;            /* of the same context, with splat_bytes; NULL: */
    sr_source seen;             /* 4 bytes a pixel: r, g, b (sRGB, over black), and 255 where splats cover it, else 0 */
    sr_source depth;            /* uint16 a pixel: millimetres along z, 0 for nothing. Not read with fresh noise */
    double fx, fy, cx, cy;      /* pixels */
    double world_to_camera[12]; /* [3, 4] row by row: a rotation and metres */
    double time;                /* as sr_draw_desc has it, for a world */
} sr_frame_desc;

/* Waits for the device. Begins a frame: draws the world, or copies the buffers, which the application may change once
 * it has returned. SR_ERR_USAGE: a frame is at work, a world without splat_bytes or of another context, none or both of
 * memory and buffer; SR_ERR_BAD_INPUT: a camera that is not finite. */
SR_API sr_status sr_renderer_begin(sr_renderer* renderer, const sr_frame_desc* frame);

/* Works on the frame for about budget_us microseconds and returns; 0: one piece of work. It stops when the next piece
 * is expected not to fit, but does one at least. Pieces are the encoder, each step of denoising, and the decoder. It
 * waits for the device, which is idle when it returns. *done (may be NULL): 1 when the frame is finished. After an
 * error the frame is given up, as by sr_renderer_cancel. SR_ERR_USAGE: no frame has begun; SR_ERR_INTERNAL: numbers
 * overflow in fp16, try fp32.
 */
SR_API sr_status sr_renderer_step(sr_renderer* renderer, uint64_t budget_us, uint32_t* done);

/* The last finished frame, 4 bytes a pixel: r, g, b (sRGB), 255. The format is R8G8B8A8_UNORM (or 0) or _SRGB, whose
 * bytes are the same; the target is else as for draws. Waits for the device. SR_ERR_USAGE: none is finished, another
 * format. */
SR_API sr_status sr_renderer_take(sr_renderer* renderer, const sr_target* target);

/* Gives up the frame that is at work; the camera is as before sr_renderer_begin. Without one it does nothing. */
SR_API sr_status sr_renderer_cancel(sr_renderer* renderer);

/* The next frame has none before it, as the first one: after a cut. SR_ERR_USAGE: a frame is at work. */
SR_API sr_status sr_renderer_restart(sr_renderer* renderer);

typedef struct sr_renderer_info {
    uint32_t struct_size;
    uint32_t steps;        /* of denoising a frame */
    uint32_t frames;       /* finished since the renderer began; the number of the next one */
    uint32_t noise;        /* SR_NOISE_FRESH, or SR_NOISE_ON_SURFACES where depth and camera are read */
    uint32_t busy;         /* 1: a frame is at work */
    uint32_t resident;     /* 1: both networks stay on the device */
    uint64_t device_bytes; /* of the context at most, as planned; the drawing of a world comes to it */
    double splat_radius;   /* metres, that the model was trained on, for sr_world_desc; 0: from the points' distance */
    float visible_alpha;   /* from which splats cover a pixel, which `seen` says */
    float reserved;
} sr_renderer_info;

SR_API sr_status sr_renderer_get_info(sr_renderer* renderer, sr_renderer_info* info);

#ifdef __cplusplus
}
#endif
#endif
