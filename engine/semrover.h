/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The C interface of semrover: C99, no other header of ours, no exception and no exit across it.
 *
 * Structures start with struct_size, which the caller sets to sizeof of the structure it was compiled with. The library
 * reads and writes no more than that; members that are missing are zero. Members that this library does not know must
 * be zero, or the call fails with SR_ERR_USAGE, so that nothing asked for is silently ignored. `next` is reserved:
 * NULL.
 *
 * Threads: different contexts may be used at the same time; one context by one thread at a time. Strings that the
 * library returns are static. Everything that a call is given is copied before it returns.
 */
#ifndef SEMROVER_H
#define SEMROVER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* raised when a binary built against an older header could misbehave; never within a soname */
#define SR_ABI_VERSION 0u

/* values are the exit codes of the program and never change; 8..69 are kept free */
typedef enum sr_status {
    SR_OK = 0,
    SR_ERR_USAGE = 2,         /* the call is wrong: a NULL, a size, an unknown option */
    SR_ERR_BAD_INPUT = 3,     /* a file or its content */
    SR_ERR_NO_DEVICE = 4,     /* no Vulkan device that can do it */
    SR_ERR_OUT_OF_MEMORY = 5, /* of the device, of the budget, or of the host */
    SR_ERR_DEVICE_LOST = 6,
    SR_ERR_PARTIAL = 7,   /* there was more than fitted */
    SR_ERR_INTERNAL = 70, /* a bug of ours */
    SR_ERR_INTERRUPTED = 130,
    SR_STATUS_IS_32_BIT = 0x7fffffff
} sr_status;

typedef struct sr_context sr_context; /* one device and what lives on it */

uint32_t sr_abi_version(void);                /* of the library; compare with SR_ABI_VERSION */
const char* sr_version(void);                 /* "0.1.0" */
const char* sr_status_name(sr_status status); /* "SR_ERR_USAGE"; "unknown" for others */

/* One line about the last call that failed: with this context, or, for NULL, in this thread without a context. Writes
 * at most `size` bytes with the terminating zero and returns the length that the whole line has. buffer may be NULL
 * with 0. */
size_t sr_last_error(const sr_context* context, char* buffer, size_t size);

/* Lines that no call returns: of the validation that sr_context_desc asks for, and of a failed assertion before the
 * process ends. The library itself prints nothing. The callback counts for the whole process, runs on the thread that
 * has something to say, one line at a time, and must not call the library. NULL, as at the beginning: lines are
 * dropped. */
void sr_set_diagnostic_callback(void (*callback)(void* user, const char* line), void* user);

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

/* All Vulkan devices, best first. devices NULL: only the count. Otherwise *count is the room in `devices`, whose first
 * element has struct_size set, which is then the distance between elements; *count becomes the number written.
 * SR_ERR_PARTIAL when there are more. */
sr_status sr_list_devices(sr_device_info* devices, uint32_t* count);

/* A device that belongs to the host program. It outlives the context. Vulkan 1.2 with timelineSemaphore and
 * robustBufferAccess enabled: files decide what shaders read. Vulkan cannot be asked which features a device was made
 * with, so the host says it. SR_ERR_USAGE without robust_buffer_access. */
typedef struct sr_vulkan_device {
    uint32_t struct_size;
    uint32_t queue_family; /* with compute */
    const void* next;
    void* instance;                 /* VkInstance */
    void* physical_device;          /* VkPhysicalDevice */
    void* device;                   /* VkDevice */
    void* queue;                    /* VkQueue */
    void* user;                     /* for the callbacks */
    void (*lock_queue)(void* user); /* around every use of the queue, from the thread that calls; both or neither */
    void (*unlock_queue)(void* user);
    uint32_t shader_float16;       /* 1: shaderFloat16 is enabled too */
    uint32_t robust_buffer_access; /* 1: robustBufferAccess is enabled; anything else is refused */
} sr_vulkan_device;

typedef struct sr_context_desc {
    uint32_t struct_size;
    uint32_t validation; /* 1: Khronos validation, see sr_set_diagnostic_callback; not with a host's device */
    const void* next;
    const char* device;             /* NULL: the best; an index, or a part of a name */
    const sr_vulkan_device* vulkan; /* not NULL: the host's, instead of one of our own */
    uint64_t max_bytes;             /* of device memory; 0: no budget */
} sr_context_desc;

/* desc may be NULL: the best device. On failure *context is NULL; sr_last_error(NULL, ..) says why. */
sr_status sr_context_create(const sr_context_desc* desc, sr_context** context);
void sr_context_destroy(sr_context* context); /* waits for what it has submitted; NULL is fine */

/* the device of a context; index is 0 for a host's */
sr_status sr_context_device(sr_context* context, sr_device_info* device);

typedef struct sr_memory_info {
    uint32_t struct_size;
    uint32_t reserved;
    uint64_t used_bytes; /* of device memory, now */
    uint64_t peak_bytes;
    uint64_t budget_bytes; /* 0: none */
} sr_memory_info;

sr_status sr_context_memory(sr_context* context, sr_memory_info* memory);

#ifdef __cplusplus
}
#endif
#endif
