/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Contexts on a Vulkan device of the application's: splats as buffers, draws that are recorded or submitted. Includes
 * vulkan_core.h, for types only: the library finds every call through the application's device. semrover.h says what
 * holds for all calls.
 */
#ifndef SEMROVER_VULKAN_H
#define SEMROVER_VULKAN_H

#include "semrover.h"

#include <vulkan/vulkan_core.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Memory that the library asks an allocator of the application's for: of one buffer, for as long as it lives. */
typedef struct sr_memory_request {
    uint32_t struct_size;
    uint32_t memory_type; /* index in VkPhysicalDeviceMemoryProperties */
    VkDeviceSize bytes;
    VkDeviceSize alignment; /* of the offset, bytes */
    uint32_t mapped;        /* 1: the pointer to it is needed, for as long as it lives */
    uint32_t reserved;
} sr_memory_request;

typedef struct sr_memory_piece {
    VkDeviceMemory memory; /* of the type that was asked for */
    VkDeviceSize offset;   /* bytes */
    void* mapped;          /* where the CPU sees the piece; NULL where `mapped` was 0 */
    void* handle;          /* the allocator's own; the library only hands it back */
} sr_memory_piece;

/* It outlives the context. For a context on it the library writes no file and reads no variable of the environment.
 * Vulkan 1.2 with timelineSemaphore enabled, and one of robustBufferAccess and pipelineRobustness: files decide what
 * shaders read. Vulkan cannot be asked which features a device was made with, so the application says it. SR_ERR_USAGE
 * where it says neither of the two. */
struct sr_vulkan_device {
    uint32_t struct_size;
    uint32_t queue_family; /* with compute */
    const void* next;
    VkInstance instance;
    VkPhysicalDevice physical_device;
    VkDevice device;
    VkQueue queue;
    void* user;                     /* for the callbacks */
    void (*lock_queue)(void* user); /* around every use of `queue`, from the thread that calls; both or neither */
    void (*unlock_queue)(void* user);
    uint32_t shader_float16;       /* 1: shaderFloat16 is enabled */
    uint32_t robust_buffer_access; /* 1: robustBufferAccess is enabled, for all shaders of the device */
    uint32_t pipeline_robustness;  /* 1: VK_EXT_pipeline_robustness is, with pipelineRobustness: the library's shaders
                                      ask for it, and no others */
    uint32_t work_queue_family;    /* with compute; another one than queue_family, or the same */
    /* 1: what matrix units need is enabled: VK_KHR_cooperative_matrix and VK_EXT_subgroup_size_control (or Vulkan 1.3)
     * with cooperativeMatrix, subgroupSizeControl, computeFullSubgroups, vulkanMemoryModel and
     * vulkanMemoryModelDeviceScope; shader_float16 must be 1, too. Without them large networks take several times as
     * long on a GPU that has them. */
    uint32_t cooperative_matrix;
    uint32_t external_memory_fd;    /* 1: VK_KHR_external_memory_fd is enabled, for semrover_gl.h */
    uint32_t external_semaphore_fd; /* 1: VK_KHR_external_semaphore_fd is enabled, likewise */
    uint32_t reserved;
    /* through which every call is found; NULL: the loader's */
    PFN_vkGetInstanceProcAddr get_instance_proc_addr;
    /* Another queue, which nobody but the library uses, so that the worker's submits and the application's frames do
     * not wait for each other; no lock is asked for. NULL: all goes to `queue`. vkDeviceWaitIdle uses this queue, too:
     * no worker may be at work then. */
    VkQueue work_queue;
    /* Instead of vkAllocateMemory, but for memory that semrover_gl.h shares. Both or neither. allocate_memory fills
     * *piece, which is zero; a status beside SR_OK (SR_ERR_OUT_OF_MEMORY) ends the call that needed the memory, with
     * that status. free_memory gets the piece back when the device has finished with it. */
    sr_status (*allocate_memory)(void* user, const sr_memory_request* request, sr_memory_piece* piece);
    void (*free_memory)(void* user, const sr_memory_piece* piece);
};

/* ---- Splats: 2D Gaussians on the device. ---- */

typedef struct sr_array {
    VkBuffer buffer; /* with usage STORAGE_BUFFER and TRANSFER_SRC */
    VkDeviceSize offset;
    VkDeviceSize bytes;
} sr_array;

/* Splat n has element n of each array. Axes: t_u = normalize(e x normal) with e the axis least aligned with the normal,
 * t_v = normal x t_u. Where element n / 64 of blocks is 0 no tile is, and the splat must not be looked at; one with
 * opacity 0 is not there either. Buffers stay the same for the life of a world, and both queue families of the context
 * may use them. What sr_world_record_updates records changes them. */
typedef struct sr_splats {
    uint32_t struct_size;
    uint32_t count;     /* elements to look at, a multiple of 64 */
    uint64_t version;   /* moves when splats come or go by sr_world_record_updates */
    sr_array positions; /* 4 floats: x, y, z in metres, opacity */
    sr_array normals;   /* 4 floats: unit normal, sigma along t_u in metres */
    sr_array colors;    /* 4 floats: r, g, b (sRGB, 0..1), sigma along t_v in metres */
    sr_array labels;    /* uint32 */
    sr_array blocks;    /* uint32 for 64 splats: 1, or 0 where no tile is */
} sr_splats;

/* The render thread. SR_ERR_USAGE: a world without splat_bytes */
SR_API sr_status sr_world_get_splats(sr_world* world, sr_splats* splats);

/* ---- Draws that nobody waits for. The context is on a device of the application's. ---- */

typedef struct sr_semaphore {
    VkSemaphore semaphore; /* of type TIMELINE */
    uint64_t value;
} sr_semaphore;

/* The render thread. Records what shows the splats of tiles that were finished, and hides those that left, all of a
 * step at once, into a primary command buffer that the application is recording, outside a render pass, from a pool of
 * queue_family. It is submitted once, to `queue`; all draws and reads of splats that follow in the queue see it. Once a
 * frame, before its other calls. done: reaches its value when this command buffer and the frame that it belongs to have
 * been executed; memory of what left, and what draws recorded before need no more, is used again then. Its semaphore is
 * destroyed after the world. So an application keeps two or three frames on their way and waits for none but its own.
 * SR_ERR_USAGE: NULL, a world without splat_bytes. */
SR_API sr_status sr_world_record_updates(sr_world* world, VkCommandBuffer commands, const sr_semaphore* done);

/* The render thread. Targets have no `memory`. Errors are those of sr_world_draw. Waits for the compiler, the first
 * time in a process; allocates the first time with a size, and whenever there are half as many splats again.
 *
 * Records the drawing into a primary command buffer that the application is recording, outside a render pass, from a
 * pool of the context's queue family. It begins with a barrier after all that was recorded or submitted before it, and
 * ends with one that lets everything after it use the targets; images go from layout_before to layout_after. Binding of
 * a compute pipeline, its descriptor set 0 and push constants are left changed.
 *
 * The camera is copied; splats are those that are shown when the commands are executed. They may be executed any number
 * of times, but executions share memory: on one queue, one after the other, or ordered by the application's semaphores.
 * Where another sr_world_record or sr_world_submit of the world follows (those with depth test and those without count
 * apart), they are only good for frames whose `done` sr_world_record_updates knows. So record every frame anew. */
SR_API sr_status sr_world_record(sr_world* world, const sr_draw_desc* draw, VkCommandBuffer commands);

typedef struct sr_sync {
    uint32_t struct_size;
    uint32_t reserved;
    const void* next;
    const sr_semaphore* waits; /* the drawing begins when all of them have reached their values */
    uint32_t wait_count;
    uint32_t signal_count;
    const sr_semaphore* signals; /* reach their values when the targets are written */
} sr_sync;

/* Both in a command buffer of the library's, submitted to `queue` at once: what is new is shown, and drawn. Calls of
 * the render thread that wait for the device wait for it too, and so for what it waits for: what signals `waits` must
 * be submitted already, or come from another thread. Of eight draws that are on their way the ninth waits for the
 * first. */
SR_API sr_status sr_world_submit(sr_world* world, const sr_draw_desc* draw, const sr_sync* sync);

/* How many tiles of the picture splats touch is known only when they are drawn. sr_world_draw repeats a picture that
 * there was too little room for; what is recorded cannot be repeated, and lacks the farthest splats then. The
 * render thread. SR_OK: of the last 16 pictures those that are finished were whole. SR_ERR_PARTIAL, once: one was not;
 * the next sr_world_record or sr_world_submit has more room. */
SR_API sr_status sr_world_check_draws(sr_world* world);

#ifdef __cplusplus
}
#endif
#endif
