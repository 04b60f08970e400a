/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Hosts with threads: contexts in parallel, one queue that two contexts and the host itself submit to, and a context
 * that goes from thread to thread between calls. All of them see the picture that one thread alone sees.
 * `tools/test --threads` runs it under ThreadSanitizer, too. */
#include "tests/capi_street.h"

#include <pthread.h>

enum { WIDTH = 48, HEIGHT = 32, PIXELS = WIDTH * HEIGHT, VISITORS = 3 };

static const char* model;

/* one thread's own */
typedef struct visitor {
    sr_context* context;
    sr_world* world;
    uint32_t done;
    sr_cell cells[MOST_CELLS];
    float color[4 * PIXELS];
    uint32_t label[2 * PIXELS];
} visitor;

static sr_status labels_for(void* user, const sr_cell_rect* window, sr_grid* grid)
{
    visitor* self = user;
    return sr_grid_set_cells(grid, self->cells, cells_of(window, self->cells));
}

static void open_world(visitor* self)
{
    const double position[3] = {1, 0, 1.5}, forward[3] = {1, 0, 0};
    sr_world_desc desc = street_world();
    desc.labels = labels_for;
    desc.user = self;
    CHECK_OK(self->context, create_world(self->context, model, &desc, &self->world));
    CHECK_OK(self->context, sr_world_focus(self->world, position, forward, 6));
}

static void step(visitor* self)
{
    CHECK_OK(self->context, sr_world_step(self->world, 5000, &self->done));
}

/* what a host asks between steps */
static void look_around(visitor* self)
{
    sr_draw_desc draw;
    sr_world_info info;
    sr_memory_info memory;
    memset(&draw, 0, sizeof draw);
    draw.struct_size = sizeof draw;
    draw.width = WIDTH;
    draw.height = HEIGHT;
    draw.fx = draw.fy = 30;
    draw.cx = 0.5 * WIDTH;
    draw.cy = 0.5 * HEIGHT;
    look(-2, draw.world_to_camera);
    draw.color.memory = self->color;
    draw.label.memory = self->label;
    CHECK_OK(self->context, sr_world_draw(self->world, &draw));
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    CHECK_OK(self->context, sr_world_get_info(self->world, &info));
    memset(&memory, 0, sizeof memory);
    memory.struct_size = sizeof memory;
    CHECK_OK(self->context, sr_context_get_memory(self->context, &memory));
    CHECK(memory.used_bytes > 0 && info.struct_size == sizeof info);
}

static void visit_all(visitor* self)
{
    open_world(self);
    while (!self->done) {
        step(self);
        look_around(self);
    }
}

static void leave(visitor* self)
{
    sr_world_destroy(self->world);
    sr_context_destroy(self->context);
    self->world = NULL;
    self->context = NULL;
    self->done = 0;
}

static void* visit_with_a_context_of_its_own(void* user)
{
    visitor* self = user;
    sr_context_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    CHECK_OK(NULL, sr_context_create(&desc, &self->context));
    visit_all(self);
    leave(self);
    return NULL;
}

static pthread_t start(void* (*run)(void*), void* user)
{
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, run, user) == 0);
    return thread;
}

static visitor alone, visitors[VISITORS];

/* something is there, and it is what one thread saw */
static void check_same(const visitor* other)
{
    CHECK(!memcmp(other->color, alone.color, sizeof alone.color));
    CHECK(!memcmp(other->label, alone.label, sizeof alone.label));
}

static void sees_a_street_alone(void)
{
    int i, there = 0;
    visit_with_a_context_of_its_own(&alone);
    for (i = 0; i < PIXELS; ++i)
        there += alone.color[4 * i + 3] > 0.5f;
    CHECK(there > PIXELS / 8);
}

static void runs_contexts_in_parallel(void)
{
    pthread_t threads[VISITORS];
    int i;
    for (i = 0; i < VISITORS; ++i)
        threads[i] = start(visit_with_a_context_of_its_own, &visitors[i]);
    for (i = 0; i < VISITORS; ++i) {
        CHECK(pthread_join(threads[i], NULL) == 0);
        check_same(&visitors[i]);
    }
}

/* the host's queue: whoever uses it holds the mutex */
typedef struct shared_queue {
    struct host host;
    pthread_mutex_t mutex;
    int users; /* at this moment; under the mutex */
    unsigned locks;
    int finished; /* visitors; under the mutex */
} shared_queue;

static void lock_queue(void* user)
{
    shared_queue* queue = user;
    CHECK(pthread_mutex_lock(&queue->mutex) == 0);
    CHECK(++queue->users == 1);
    ++queue->locks;
}

static void unlock_queue(void* user)
{
    shared_queue* queue = user;
    CHECK(--queue->users == 0);
    CHECK(pthread_mutex_unlock(&queue->mutex) == 0);
}

typedef struct guest {
    shared_queue* queue;
    visitor* visitor;
} guest;

static void* visit_on_the_host_s_queue(void* user)
{
    const guest* self = user;
    sr_vulkan_device vulkan = lent(&self->queue->host);
    sr_context_desc desc;
    vulkan.user = self->queue;
    vulkan.lock_queue = lock_queue;
    vulkan.unlock_queue = unlock_queue;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    CHECK_OK(NULL, sr_context_create(&desc, &self->visitor->context));
    visit_all(self->visitor);
    leave(self->visitor);
    lock_queue(self->queue);
    ++self->queue->finished;
    unlock_queue(self->queue);
    return NULL;
}

/* the host's own submits, one after the other; how many */
static unsigned submit_until_finished(shared_queue* queue)
{
    VkSubmitInfo nothing = {0};
    VkFenceCreateInfo info = {0};
    VkFence fence;
    unsigned submits = 0;
    int finished = 0;
    nothing.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
    CHECK(vkCreateFence(queue->host.device, &info, NULL, &fence) == VK_SUCCESS);
    for (; finished < 2; ++submits) {
        lock_queue(queue);
        CHECK(vkQueueSubmit(queue->host.queue, 1, &nothing, fence) == VK_SUCCESS);
        finished = queue->finished;
        unlock_queue(queue);
        CHECK(vkWaitForFences(queue->host.device, 1, &fence, VK_TRUE, UINT64_MAX) == VK_SUCCESS);
        CHECK(vkResetFences(queue->host.device, 1, &fence) == VK_SUCCESS);
    }
    vkDestroyFence(queue->host.device, fence, NULL);
    return submits;
}

static void shares_a_queue(void)
{
    static shared_queue queue;
    guest guests[2];
    pthread_t threads[2];
    unsigned submits;
    int i;
    queue.host = make_host();
    CHECK(pthread_mutex_init(&queue.mutex, NULL) == 0);
    for (i = 0; i < 2; ++i) {
        guests[i].queue = &queue;
        guests[i].visitor = &visitors[i];
        threads[i] = start(visit_on_the_host_s_queue, &guests[i]);
    }
    submits = submit_until_finished(&queue);
    for (i = 0; i < 2; ++i) {
        CHECK(pthread_join(threads[i], NULL) == 0);
        check_same(&visitors[i]);
    }
    printf("one queue: %u submits of the host's, %u locks by both contexts\n", submits, queue.locks - submits - 2);
    CHECK(queue.users == 0 && queue.locks > submits + 2);
    CHECK(pthread_mutex_destroy(&queue.mutex) == 0);
    destroy_host(&queue.host);
}

static void* step_once(void* user)
{
    step(user);
    return NULL;
}

static void* look_once(void* user)
{
    look_around(user);
    return NULL;
}

/* one thread at a time, but never the one before */
static void goes_from_thread_to_thread(void)
{
    visitor* self = &visitors[0];
    sr_context_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    CHECK_OK(NULL, sr_context_create(&desc, &self->context));
    open_world(self);
    while (!self->done) {
        CHECK(pthread_join(start(step_once, self), NULL) == 0);
        CHECK(pthread_join(start(look_once, self), NULL) == 0);
    }
    leave(self);
    check_same(self);
}

static void* fail_here(void* user)
{
    CHECK(sr_grid_create(*(const double*)user, NULL) == SR_ERR_USAGE && says(NULL, "NULL"));
    return NULL;
}

/* calls as fast as they come: each works or is refused */
static void* ask_often(void* user)
{
    visitor* self = user;
    sr_world_info info = SR_INIT(sr_world_info);
    int i;
    for (i = 0; i < 20000; ++i) {
        const sr_status status = sr_world_get_info(self->world, &info);
        CHECK(status == SR_OK || (status == SR_ERR_USAGE && says(NULL, "another call is at work")));
    }
    return NULL;
}

static void two_threads_get_a_status(void)
{
    visitor* self = &visitors[0];
    sr_context_desc desc = SR_INIT(sr_context_desc);
    pthread_t other;
    int refused = 0;
    self->done = 0;
    CHECK_OK(NULL, sr_context_create(&desc, &self->context));
    open_world(self);
    other = start(ask_often, self);
    while (!self->done) {
        const sr_status status = sr_world_step(self->world, 5000, &self->done);
        CHECK(status == SR_OK || status == SR_ERR_USAGE);
        refused += status == SR_ERR_USAGE;
    }
    CHECK(pthread_join(other, NULL) == 0);
    printf("steps refused beside another thread: %d\n", refused);
    leave(self);
}

/* without a context, each thread has an error of its own */
static void keeps_errors_apart(void)
{
    double size = 1;
    sr_grid* grid = NULL;
    CHECK(sr_grid_create(-1, &grid) == SR_ERR_BAD_INPUT && says(NULL, "voxel size"));
    CHECK(pthread_join(start(fail_here, &size), NULL) == 0);
    CHECK(says(NULL, "voxel size"));
}

int main(int argc, char** argv)
{
    CHECK(argc == 2);
    model = argv[1];
    sr_set_diagnostic_callback(print_line, stderr);
    keeps_errors_apart();
    sees_a_street_alone();
    runs_contexts_in_parallel();
    shares_a_queue();
    goes_from_thread_to_thread();
    two_threads_get_a_status();
    return 0;
}
