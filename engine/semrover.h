/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The C interface of semrover: C99, no other header of ours, no exception and no exit across it. "The application" is
 * the program that calls it. docs/embedding.md has a complete example. Pictures are in semrover_draw.h and refined
 * frames in semrover_renderer.h, which this header includes; a Vulkan device of the application's in semrover_vulkan.h,
 * OpenGL in semrover_gl.h, which it does not.
 *
 * Structures start with struct_size: `sr_world_desc desc = SR_INIT(sr_world_desc);` sets it, and all else to zero. The
 * library reads and writes no more than that; members that are missing are zero. Members that this library does not
 * know must be zero, or the call fails with SR_ERR_USAGE, so that nothing asked for is silently ignored. `next` is
 * reserved: NULL.
 *
 * Threads and waiting are said at each call, in these words:
 * - "Any thread": at any time.
 * - "The worker": a thread that makes things, while another one draws. "The render thread": one that draws, while a
 *   worker is at work. Each group of calls by one thread at a time, which may be the same.
 * - Where nothing is said, one thread at a time for a context with the models, worlds and renderers on it, and no
 * worker and render thread beside it; and one for a grid.
 * - "Waits for" the disk, the device (until what was submitted has finished), the compiler (of shaders: seconds at the
 *   first time, then from a cache), drivers, a callback. Where nothing is said, a call returns at once.
 * Different contexts may be used at the same time. A call that meets another one with the same context, on another
 * thread or around the callback that makes it, returns SR_ERR_USAGE, of which sr_last_error(NULL, ..) has the line;
 * sr_.._destroy does nothing then.
 *
 * Callbacks run on the thread that calls, before the call returns. Strings that the library returns are static.
 * Everything that a call is given is copied before it returns, but for what belongs to Vulkan, and models in memory
 * (sr_file). Handles are destroyed before what they were made with, but for models.
 *
 * Where memory ends, of the device, of a budget or of the host, a call returns SR_ERR_OUT_OF_MEMORY. All handles stay
 * good, and the call may be made again: edits, foci and voxels that were set are kept. Of a frame that is refined the
 * next call is sr_renderer_begin. A tile that a thread cannot write into a cache is a warning. After SR_ERR_DEVICE_LOST
 * every call that needs the device returns it again; destroy all that is on the context, and make another one. To
 * destroy is always possible. The process ends only by the system's own policy: Linux may kill it where it has promised
 * more memory than there is.
 */
#ifndef SEMROVER_H
#define SEMROVER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
/* a structure with its struct_size, all else zero */
template <typename T>
inline T sr_init()
{
    T made{};
    made.struct_size = sizeof made;
    return made;
}
#define SR_INIT(type) sr_init<type>()
extern "C" {
#else
#define SR_INIT(type) ((type){.struct_size = sizeof(type)})
#endif

#ifndef SR_API
#if !defined(_WIN32)
#define SR_API __attribute__((visibility("default")))
#elif defined(SR_LIBRARY)
#define SR_API __declspec(dllexport)
#else
#define SR_API __declspec(dllimport)
#endif
#endif

#define SR_VERSION 100u /* 10000 major + 100 minor + patch, of this header */

/* raised when a binary built against an older header could misbehave; never within a soname */
#define SR_ABI_VERSION 0u

/* values are the exit codes of the program and never change; 8..69 are kept free. The program's 75, another process at
 * work in the same folder, is of no call */
typedef enum sr_status {
    SR_OK = 0,
    SR_ERR_USAGE = 2,         /* the call is wrong: a NULL, a size, a number out of range or not finite */
    SR_ERR_BAD_INPUT = 3,     /* a file or its content */
    SR_ERR_NO_DEVICE = 4,     /* no Vulkan device that can do it */
    SR_ERR_OUT_OF_MEMORY = 5, /* of the device, of the budget, or host memory */
    SR_ERR_DEVICE_LOST = 6,
    SR_ERR_PARTIAL = 7,   /* there was more than fitted */
    SR_NOT_YET = 8,       /* of a labels callback: ask again after sr_world_labels_ready */
    SR_ERR_INTERNAL = 70, /* a bug of ours */
    SR_ERR_INTERRUPTED = 130,
    SR_STATUS_IS_32_BIT = 0x7fffffff
} sr_status;

typedef struct sr_context sr_context; /* one device and what lives on it */

/* Any thread. */
SR_API uint32_t sr_abi_version(void);                /* of the library; compare with SR_ABI_VERSION */
SR_API const char* sr_version(void);                 /* "0.1.0" */
SR_API const char* sr_status_name(sr_status status); /* "SR_ERR_USAGE"; "unknown" for others */

/* Any thread. One line about the last call that failed: with this context or a
 * world or renderer on it, or, for NULL, in this thread without a context, as calls with grids are. Writes at most
 * `size` bytes with the terminating zero and returns the length that the whole line has. buffer may be NULL with 0. */
SR_API size_t sr_last_error(const sr_context* context, char* buffer, size_t size);

/* Lines that no call returns: of the validation that sr_context_desc asks for. (A failed assertion, a bug of ours,
 * makes its call return SR_ERR_INTERNAL with its text; its context should not be used further.) The library itself
 * prints nothing. The callback counts for the whole process, runs on the thread that has something to say, one line at
 * a time, and must not call the library. NULL, as at the beginning: lines are dropped. Any thread. */
SR_API void sr_set_diagnostic_callback(void (*callback)(void* user, const char* line), void* user);

typedef struct sr_device_info {
    uint32_t struct_size;
    uint32_t index; /* for sr_context_desc.device */
    char name[256];
    char driver[256];
    char refusal[256];     /* why it cannot be used; empty if it can */
    char type[16];         /* "discrete", "integrated", "other", "cpu" */
    char api[16];          /* "1.3.230" */
    uint64_t memory_bytes; /* of the largest device-local heap */
} sr_device_info;

/* Any thread; waits for drivers. All Vulkan devices, best first. devices NULL: only the count. Otherwise *count is the
 * room in `devices`, whose first element has struct_size set, which is then the distance between elements; *count
 * becomes the number written. SR_ERR_PARTIAL when there are more. */
SR_API sr_status sr_list_devices(sr_device_info* devices, uint32_t* count);

typedef struct sr_vulkan_device sr_vulkan_device; /* semrover_vulkan.h */

typedef struct sr_context_desc {
    uint32_t struct_size;
    uint32_t validation; /* 1: Khronos validation, see sr_set_diagnostic_callback; not with `vulkan` */
    const void* next;
    const char* device; /* NULL: the best; an index, UUID, PCI address or part of a name; "auto": as --device auto */
    const sr_vulkan_device* vulkan; /* the application's device; NULL: one of the library's own */
    uint64_t max_bytes;             /* of device memory; 0: no budget */
    /* What sr_context_get_pipeline_cache gave another process, read before the call returns. One that is damaged, or of
     * another driver, is ignored. NULL: a context of our own keeps a file in $XDG_CACHE_HOME/semrover. */
    const void* pipeline_cache;
    uint64_t pipeline_cache_bytes;
    /* Copied; for every Vulkan object that the library makes, with `vulkan` too. Called from the threads that call the
     * library, and from threads of the driver. NULL: the driver's own. */
    const struct VkAllocationCallbacks* allocation_callbacks;
    uint32_t share_by_fd; /* 1: enables what the device has of what semrover_gl.h shares memory by. Not with `vulkan`,
                             which says by itself what it has */
    uint32_t reserved;
} sr_context_desc;

/* desc may be NULL: the best device. On failure *context is NULL; sr_last_error(NULL, ..) says why. Any thread; waits
 * for drivers. */
SR_API sr_status sr_context_create(const sr_context_desc* desc, sr_context** context);
SR_API void sr_context_destroy(sr_context* context); /* waits for the device; NULL is fine */

/* Any thread. index is 0 for the application's */
SR_API sr_status sr_context_get_device(sr_context* context, sr_device_info* device);

typedef struct sr_memory_info {
    uint32_t struct_size;
    uint32_t reserved;
    uint64_t used_bytes; /* of device memory, now */
    uint64_t peak_bytes;
    uint64_t budget_bytes; /* 0: none */
} sr_memory_info;

/* any thread */
SR_API sr_status sr_context_get_memory(sr_context* context, sr_memory_info* memory);

/* What the driver compiled so far, to be kept by the application: shaders are compiled again in a process that does not
 * get it. data NULL: only the size. Otherwise *bytes is the room at `data`; it becomes the size. SR_ERR_PARTIAL: there
 * is less room than that, and nothing is written. */
SR_API sr_status sr_context_get_pipeline_cache(sr_context* context, void* data, uint64_t* bytes);

/* ---- Grids: labelled voxels of one size, each with coloured points or none. Host memory only. ---- */

typedef struct sr_grid sr_grid;

#define SR_NO_CELL 0xffffffffu
#define SR_CLASSES 20u

/* Any thread. The name of a class, "road", static, or NULL where there is no such class; and its colour in the palette:
 * r, g, b, 0..255. SR_ERR_USAGE: a NULL, no such class. */
SR_API const char* sr_class_name(uint32_t class_id);
SR_API sr_status sr_class_color(uint32_t class_id, uint8_t rgb[3]);

/* Cell (i, j, k) spans [i, i+1) x [j, j+1) x [k, k+1) voxel sizes, x forward, y left, z up. Coordinates: -2^20..2^20.
 * label: a class, 0 road, 1 sidewalk, 2 building, ... 19 road-lane (docs/method.md, section 1.1); SR_NO_CELL: there is
 * no voxel. */
typedef struct sr_cell {
    int32_t i, j, k;
    uint32_t label;
} sr_cell;

typedef struct sr_grid_info {
    uint32_t struct_size;
    uint32_t points_per_voxel; /* 0: there are labels only */
    uint64_t cells;
    double voxel_size; /* metres */
} sr_grid_info;

/* On failure *grid is NULL. read: a .sgrid file, or a folder of tiles (docs/formats.md, section 2); waits for the disk.
 * SR_ERR_USAGE: a NULL; SR_ERR_BAD_INPUT: a voxel size outside 1 mm..1 km, a file or its content. */
SR_API sr_status sr_grid_create(double voxel_size, sr_grid** grid);
SR_API sr_status sr_grid_read(const char* path, sr_grid** grid);
SR_API void sr_grid_destroy(sr_grid* grid); /* NULL is fine */

/* Writes a .sgrid, whole or not at all; a file that is there is replaced. Waits for the disk. SR_ERR_BAD_INPUT: a grid
 * without voxels, the disk. */
SR_API sr_status sr_grid_write(const sr_grid* grid, const char* path);

SR_API sr_status sr_grid_get_info(const sr_grid* grid, sr_grid_info* info);

/* Adds voxels, changes labels, or takes voxels away (SR_NO_CELL); of equal voxels the last counts. Voxels whose label
 * changes lose their points. Cheap in pieces, too: the grid is put together when it is next read. SR_ERR_BAD_INPUT:
 * coordinates, labels; nothing is changed then. */
SR_API sr_status sr_grid_set_cells(sr_grid* grid, const sr_cell* cells, uint64_t count);

/* The voxels from number `first` on, sorted by i, j, k. cells: room for `count`; *written: how many there were. */
SR_API sr_status sr_grid_get_cells(const sr_grid* grid, uint64_t first, uint64_t count, sr_cell* cells,
                                   uint64_t* written);

/* The points of the same cells, points_per_voxel each: x, y, z in metres in the world's frame, then r, g, b (sRGB,
 * 0..1). points: room for count * points_per_voxel * 6 floats. Cells without points have zeros. SR_ERR_BAD_INPUT: a
 * grid without points. */
SR_API sr_status sr_grid_get_points(const sr_grid* grid, uint64_t first, uint64_t count, float* points,
                                    uint64_t* written);

/* ---- Models: networks on the device, loaded once for any number of worlds and renderers. ---- */

typedef struct sr_model sr_model;

/* A file of a model that the application has in memory. The bytes are not copied: they stay where they are, and as they
 * are, until the model and all that is made with it are destroyed. */
typedef struct sr_file {
    const char* path; /* below the model's folder: "voxfield_transformer/config.json" */
    const void* data;
    uint64_t bytes;
} sr_file;

#define SR_MODEL_VOXFIELD 1u /* the voxfield transformer, which makes points */
#define SR_MODEL_RENDERER 2u /* the deferred renderer, which makes frames */

#define SR_FP16 0u
#define SR_FP32 1u

typedef struct sr_model_desc {
    uint32_t struct_size;
    uint32_t parts; /* SR_MODEL_.., all of which must be there; 0: what the model has */
    const void* next;
    const char* path;     /* a folder (docs/models.md), or a renderer's .safetensors file of the LDM layout */
    const sr_file* files; /* the folder in memory; `path` is NULL then, or a folder or file among them */
    uint64_t file_count;
    uint32_t precision; /* SR_FP16, or SR_FP32 with twice the memory */
    uint32_t reserved;
    /* Bytes that are on the device, of all that will be: at the beginning, after each tensor and at the end. What is
     * not 0 gives up: sr_model_load returns SR_ERR_INTERRUPTED. NULL: none */
    uint32_t (*progress)(void* user, uint64_t done, uint64_t total);
    void* user; /* for the callback */
    const char* preset; /* of the voxfield transformer: one of `presets` in model_index.json; NULL: none */
} sr_model_desc;

/* Reads the weights and copies them to the device: waits for the disk and the device, seconds for a large model. Where
 * sr_context_desc.max_bytes has no room for both networks of a renderer, sr_renderers load them in turn. context:
 * outlives the model. On failure *model is NULL, and nothing stays on the device. SR_ERR_USAGE: a NULL, files, preset;
 * SR_ERR_BAD_INPUT: the model's files; SR_ERR_OUT_OF_MEMORY, SR_ERR_INTERRUPTED. */
SR_API sr_status sr_model_load(sr_context* context, const sr_model_desc* desc, sr_model** model);

/* Worlds and renderers that are made with it go on: the last of them frees the weights. NULL is fine. */
SR_API void sr_model_destroy(sr_model* model);

/* what a voxfield transformer can be conditioned on beside labels */
#define SR_CONDITION_OBJECTS 1u /* boxes: a voxel's place in its object */
#define SR_CONDITION_COLORS 2u  /* the object's colour */
#define SR_CONDITION_PARTS 4u   /* windows, wheels, lamps */

typedef struct sr_model_info {
    uint32_t struct_size;
    uint32_t parts;            /* SR_MODEL_.. that are loaded */
    uint32_t precision;        /* SR_FP16 or SR_FP32 */
    uint32_t conditions;       /* SR_CONDITION_.. */
    uint64_t device_bytes;     /* of the weights */
    double voxel_size;         /* metres */
    uint32_t points_per_voxel; /* 0: no voxfield transformer, and so on */
    uint32_t steps;            /* of denoising points, where a world does not say */
    uint32_t renderer_steps; /* of denoising a frame, where sr_renderer_desc does not say; 0: no renderer, and so on */
    uint32_t window_frames;  /* made together: 1, or more of a renderer of videos, which sr_renderer cannot use yet */
    double splat_radius;     /* metres, that the renderer was trained on; 0: from the points' distance */
} sr_model_info;

SR_API sr_status sr_model_get_info(const sr_model* model, sr_model_info* info);

#define SR_SAMPLER_DDPM 0u
#define SR_SAMPLER_DDIM 1u
#define SR_SAMPLER_DPMPP_2M 2u

#define SR_KNOWN_NOISED 0u /* the network sees finished voxels with the noise of the step, as in RePaint */
#define SR_KNOWN_CLEAN 1u  /* as they are: for a network that was trained so */

#define SR_REGIONS_COMPLETE 0u /* docs/method.md, section 4.1 */
#define SR_REGIONS_RIM 1u

/* How points are denoised, beside the number of steps (docs/method.md, sections 3 and 4). All of it decides the bytes.
 */
typedef struct sr_generation {
    uint32_t struct_size;
    uint32_t sampler;         /* SR_SAMPLER_.. */
    uint32_t known;           /* SR_KNOWN_.. */
    uint32_t regions;         /* SR_REGIONS_.. */
    uint32_t region_size;     /* voxels that are denoised together, at most */
    uint32_t least_uncovered; /* voxels of a region that no other has, at least */
    uint32_t jump_length;     /* RePaint's jumps back, in steps; 0: none */
    uint32_t jump_count;      /* rounds that each of them goes; 1: none */
    uint32_t guidance_from;   /* timesteps from.. */
    uint32_t guidance_until;  /* ..until which steps are guided, 0..10000 */
    double eta;               /* share of fresh noise in a step of DDIM, 0..1 */
    double guidance_scale;    /* 0..1000; 1: no guidance */
    double guidance_radius;   /* metres within which the unguided half sees other voxels */
} sr_generation;

/* What a world takes whose desc does not say it: to be changed, and given to sr_world_desc.generation. SR_ERR_USAGE: a
 * model without a voxfield transformer */
SR_API sr_status sr_model_get_generation(const sr_model* model, sr_generation* generation);

/* An upright box of one class that conditions the voxels in it. Metres, in the world's frame. */
typedef struct sr_object {
    uint32_t id;    /* unique among them: each has noise of its own */
    uint32_t label; /* its class */
    double center[3];
    double size[3];   /* along the heading, across it, up */
    double heading;   /* where its front looks: radians from x towards y */
    float color[3];   /* r, g, b (sRGB, 0..1) */
    uint32_t colored; /* 1: it has this colour */
    uint32_t part;    /* 1: of an object of its class, as a window is of a house */
    uint32_t reserved;
} sr_object;

/* Objects of a .json file (docs/formats.md, section 2.8). objects NULL: only the count. Otherwise *count is the room;
 * it becomes the number written. SR_ERR_PARTIAL when there are more; SR_ERR_BAD_INPUT: the file. Any thread; waits for
 * the disk. */
SR_API sr_status sr_read_objects(const char* path, sr_object* objects, uint64_t* count);

/* ---- Worlds: a street of any extent, generated around a camera as it moves. ---- */

typedef struct sr_world sr_world;

/* voxels low <= (i, j) <= high, all k */
typedef struct sr_cell_rect {
    int32_t low[2], high[2];
} sr_cell_rect;

/* Labels come from one of grid, folder and labels. The callback adds the voxels of a rectangle to a grid, with
 * sr_grid_set_cells and nothing else of the library; it is asked again for a rectangle that was dropped, and answers
 * alike. Where it does not know the labels yet it returns SR_NOT_YET: the tiles that need them wait for
 * sr_world_labels_ready, and no others. What it returns beside these ends the call that needed the labels, with that
 * status.
 *
 * Order-free: the bytes of a place depend on model, seed, the labels near it and edits, not on the way of the camera.
 * One device and driver are meant: others round in other ways. */
#define SR_CONDITIONING_GUESSED 0u /* objects are guessed of the labels, where the model can be conditioned */
#define SR_CONDITIONING_NONE 1u    /* labels alone */
#define SR_CONDITIONING_GIVEN 2u   /* `objects`; SR_ERR_BAD_INPUT where the model cannot be conditioned on them */

typedef struct sr_world_desc {
    uint32_t struct_size;
    uint32_t steps; /* of denoising; 0: as the model says */
    const void* next;
    const sr_model* model; /* of the same context, with a voxfield transformer. NULL: nothing is generated, and the
                              world shows the points that its grid or folder has */
    const sr_grid* grid;   /* its labels are copied; without a model its points, too */
    const char* folder;    /* of tiles */
    sr_status (*labels)(void* user, const sr_cell_rect* rect, sr_grid* grid);
    void (*message)(void* user, const char* line); /* warnings, during sr_world_create and steps; NULL: none */
    void* user;                                    /* for the callbacks */
    const char* cache; /* a folder for finished tiles, made where it is missing, also for later sessions and worlds
                          of other seeds, settings or edits; one that cannot be written is read. NULL: none. One
                          world at a time */
    const sr_generation* generation; /* NULL: as the model says */
    const sr_object* objects;        /* SR_CONDITIONING_GIVEN. Splats know which of them they are of: pictures of
                                        instances, sr_world_set_actors. Without a model they do that alone */
    uint64_t object_count;
    uint64_t seed;
    uint64_t host_bytes;    /* for tiles in memory; 0: no budget */
    uint64_t splat_bytes;   /* for splats on the device, 60 bytes each, 20 a voxel; allocated here. 0: no splats */
    double tile_size;       /* metres; 0: 9.6. Another size gives another world */
    double splat_radius;    /* metres; 0: from the distance of the points */
    uint32_t tiles_at_once; /* generated together; 0: as suits the device. Does not change the bytes */
    uint32_t conditioning;  /* SR_CONDITIONING_.. */
    double detail_distance; /* metres: a tile within it has a splat of each point, up to twice as far one of each half
                               voxel, up to four times one of each voxel, and so on. So a kilometre takes little more
                               than what is near. 0: each point has one everywhere */

    uint32_t portable_cache; /* 1: what another device or driver put into the cache is taken, too, so that it can be
                                shipped. Points that are made beside it are rounded in another way. 0 and 1 do not find
                                each other's tiles */
    uint32_t reserved;
} sr_world_desc;

/* The worker. Waits for the compiler and the device, so that no step compiles, and for the disk. On failure *world is
 * NULL. SR_ERR_USAGE, SR_ERR_BAD_INPUT (files, a grid that does not go with the model), SR_ERR_OUT_OF_MEMORY. */
SR_API sr_status sr_world_create(sr_context* context, const sr_world_desc* desc, sr_world** world);
/* Gives up what is at work. Waits for the device and the disk. NULL is fine. */
SR_API void sr_world_destroy(sr_world* world);

/* What is wanted from now on: all tiles within `radius` metres of the position, seen from above; nearest first, and
 * what lies in `direction` before what lies behind. Any thread, every frame: the next step looks at it. SR_ERR_USAGE:
 * numbers that are not finite, a radius that is not 0..2000 m. */
SR_API sr_status sr_world_focus(sr_world* world, const double position[3], const double direction[3], double radius);

/* a place that a world is wanted around, as sr_world_focus has it */
typedef struct sr_focus {
    double position[3], direction[3];
    double radius;
} sr_focus;

/* Several at once, for players or cameras that are apart: all tiles within the radius of any of them; what is nearest
 * to one of them first. The last call of this one and of sr_world_focus counts. Else as sr_world_focus. SR_ERR_USAGE: a
 * count that is not 1..64, too. */
SR_API sr_status sr_world_foci(sr_world* world, const sr_focus* foci, uint32_t count);

/* The worker. Works for about budget_us microseconds and returns; 0: one piece of work. It stops when the next piece is
 * expected not to fit, going by those of its kind before, but does one at least. A piece is a denoising step of a few
 * regions at most, or a tile read, written or turned into splats. New splats lie where no draw looks: what is on its
 * way need not have ended, and sr_world_record_updates (semrover_vulkan.h) or a draw that says so shows them. Waits for
 * what it submits, for the disk and for the labels callback. *done (may be NULL): 1 when all that is wanted and fits
 * the budgets is finished; splats that only wait until others have left do not count, but `full` is 1 then. After an
 * error the next step tries again. */
SR_API sr_status sr_world_step(sr_world* world, uint64_t budget_us, uint32_t* done);

/* Changes labels as sr_grid_set_cells does. The tiles of these voxels, and those beside them that saw their points, are
 * generated anew by the next steps. Their splats stay until the new ones are shown. Any thread. */
SR_API sr_status sr_world_edit(sr_world* world, const sr_cell* cells, uint64_t count);

/* The callback knows the labels of a rectangle for which it returned SR_NOT_YET. Any thread. */
SR_API sr_status sr_world_labels_ready(sr_world* world, const sr_cell_rect* rect);

typedef struct sr_world_info {
    uint32_t struct_size;
    uint32_t full;       /* 1: host_bytes or splat_bytes has no room for more of what is wanted */
    uint64_t wanted;     /* tiles of the focus, or of all foci */
    uint64_t finished;   /* of these, as far as steps have looked */
    uint64_t in_memory;  /* tiles */
    uint64_t host_bytes; /* of these */
    uint64_t generated;  /* tiles so far, and so on */
    uint64_t loaded;     /* from the cache */
    uint64_t dropped;    /* from memory: they come back when they are wanted */
    uint64_t splats;     /* on the device */
    double voxel_size;   /* metres */
    uint32_t tile_cells; /* edge of a tile */
    uint32_t points_per_voxel;
} sr_world_info;

/* Any thread. While a step is at work: as it was before */
SR_API sr_status sr_world_get_info(sr_world* world, sr_world_info* info);

/* Copies; the time goes with the voxels. The finished voxels of a rectangle that are in memory, with their points;
 * maybe none. The application destroys it. Any thread; waits for a step that is at work. */
SR_API sr_status sr_world_copy_cells(sr_world* world, const sr_cell_rect* rect, sr_grid** grid);

/* The worker. Waits until the cache has all that is finished; an error where it cannot be written, as on a full disk */
SR_API sr_status sr_world_flush(sr_world* world);

#ifdef __cplusplus
}
#endif

#include "semrover_draw.h"
#include "semrover_renderer.h"
#endif
