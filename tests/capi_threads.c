/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Hosts with threads: contexts in parallel, one queue that two contexts and the host itself submit to, a context that
 * goes from thread to thread between calls, and one whose worker steps while frames are on their way. All of them see
 * the picture that one thread alone sees. `tools/test --threads` runs it under ThreadSanitizer, too. */
#include "tests/support/capi_memory.h"
#include "tests/support/capi_street.h"

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

/* a piece at a time: where a tile's splats find room, and so which of two that are exactly equally far is blended first,
 * goes by which of those before were shown already */
static void step(visitor* self)
{
    CHECK_OK(self->context, sr_world_step(self->world, 0, &self->done));
}

/* what an application asks between steps */
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

/* the application's queue: whoever uses it holds the mutex */
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

/* the application's own submits, one after the other; how many */
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

/* ---- one context, two threads: a worker that steps, and one that records and submits frames */

enum { FRAMES_ON_THEIR_WAY = 2, LEAST_FRAMES = 12 };

typedef struct animation {
    shared_queue queue;
    visitor* visitor;
    VkSemaphore timeline; /* frame n reaches n */
    VkCommandPool pool;
    VkCommandBuffer commands[FRAMES_ON_THEIR_WAY];
    struct host_buffer color[FRAMES_ON_THEIR_WAY], label[FRAMES_ON_THEIR_WAY];
    int settled; /* the worker has nothing left to do; under the mutex */
    int ended;   /* likewise: it has been told to end */
} animation;

static int flag_of(animation* self, const int* flag)
{
    int value;
    CHECK(pthread_mutex_lock(&self->queue.mutex) == 0);
    value = *flag;
    CHECK(pthread_mutex_unlock(&self->queue.mutex) == 0);
    return value;
}

static void set_flag(animation* self, int* flag)
{
    CHECK(pthread_mutex_lock(&self->queue.mutex) == 0);
    *flag = 1;
    CHECK(pthread_mutex_unlock(&self->queue.mutex) == 0);
}

static void* work(void* user)
{
    animation* self = user;
    uint32_t done;
    while (!flag_of(self, &self->ended)) {
        CHECK_OK(self->visitor->context, sr_world_step(self->visitor->world, 5000, &done));
        if (done)
            set_flag(self, &self->settled);
    }
    return NULL;
}

static void open_animation(animation* self)
{
    sr_vulkan_device vulkan;
    sr_context_desc desc;
    VkCommandPoolCreateInfo pool = {0};
    VkCommandBufferAllocateInfo commands = {0};
    int i;
    CHECK(pthread_mutex_init(&self->queue.mutex, NULL) == 0);
    self->queue.host = make_host();
    vulkan = lent(&self->queue.host);
    vulkan.user = &self->queue;
    vulkan.lock_queue = lock_queue;
    vulkan.unlock_queue = unlock_queue;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    CHECK_OK(NULL, sr_context_create(&desc, &self->visitor->context));
    self->timeline = make_timeline(&self->queue.host);
    pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    CHECK(vkCreateCommandPool(self->queue.host.device, &pool, NULL, &self->pool) == VK_SUCCESS);
    commands.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    commands.commandPool = self->pool;
    commands.commandBufferCount = FRAMES_ON_THEIR_WAY;
    CHECK(vkAllocateCommandBuffers(self->queue.host.device, &commands, self->commands) == VK_SUCCESS);
    for (i = 0; i < FRAMES_ON_THEIR_WAY; ++i) {
        self->color[i] = make_buffer(&self->queue.host, sizeof alone.color);
        self->label[i] = make_buffer(&self->queue.host, sizeof alone.label);
    }
}

static void close_animation(animation* self)
{
    int i;
    leave(self->visitor);
    for (i = 0; i < FRAMES_ON_THEIR_WAY; ++i) {
        destroy_buffer(&self->queue.host, &self->color[i]);
        destroy_buffer(&self->queue.host, &self->label[i]);
    }
    vkDestroyCommandPool(self->queue.host.device, self->pool, NULL);
    vkDestroySemaphore(self->queue.host.device, self->timeline, NULL);
    destroy_host(&self->queue.host);
    CHECK(pthread_mutex_destroy(&self->queue.mutex) == 0);
}

static void submit_frame(animation* self, VkCommandBuffer commands, uint64_t number)
{
    VkTimelineSemaphoreSubmitInfo numbers = {0};
    VkSubmitInfo submit = {0};
    numbers.sType = VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO;
    numbers.signalSemaphoreValueCount = 1;
    numbers.pSignalSemaphoreValues = &number;
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.pNext = &numbers;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    submit.signalSemaphoreCount = 1;
    submit.pSignalSemaphores = &self->timeline;
    lock_queue(&self->queue);
    CHECK(vkQueueSubmit(self->queue.host.queue, 1, &submit, VK_NULL_HANDLE) == VK_SUCCESS);
    unlock_queue(&self->queue);
}

/* frame `number`, when the one before the last is finished */
static void animate(animation* self, uint64_t number)
{
    const int place = (int)(number % FRAMES_ON_THEIR_WAY);
    const double position[3] = {1, 0, 1.5}, forward[3] = {1, 0, 0};
    const sr_semaphore done = {self->timeline, number};
    const sr_context* context = self->visitor->context;
    VkCommandBufferBeginInfo begin = {0};
    sr_draw_desc draw = camera_at(-2, WIDTH, HEIGHT);
    sr_world* world = self->visitor->world;
    sr_world_info info;
    sr_status whole;
    memset(&info, 0, sizeof info);
    info.struct_size = sizeof info;
    draw.fx = draw.fy = 30;
    draw.color.buffer = self->color[place].buffer;
    draw.label.buffer = self->label[place].buffer;
    if (number > FRAMES_ON_THEIR_WAY)
        wait_value(&self->queue.host, self->timeline, number - FRAMES_ON_THEIR_WAY);
    CHECK_OK(context, sr_world_focus(world, position, forward, 6));
    CHECK_OK(context, sr_world_get_info(world, &info));
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    CHECK(vkBeginCommandBuffer(self->commands[place], &begin) == VK_SUCCESS);
    CHECK_OK(context, sr_world_record_updates(world, self->commands[place], &done));
    whole = sr_world_check_draws(world);
    CHECK(whole == SR_OK || whole == SR_ERR_PARTIAL);
    CHECK_OK(context, sr_world_record(world, &draw, self->commands[place]));
    CHECK(vkEndCommandBuffer(self->commands[place]) == VK_SUCCESS);
    submit_frame(self, self->commands[place], number);
}

/* a wall across the road, and away again: the world is as it was, after tiles have left and come */
static void edit(animation* self, uint32_t label)
{
    sr_cell cells[2];
    int i;
    for (i = 0; i < 2; ++i) {
        cells[i].i = 3;
        cells[i].j = i;
        cells[i].k = 1;
        cells[i].label = label;
    }
    CHECK_OK(self->visitor->context, sr_world_edit(self->visitor->world, cells, 2));
}

typedef struct splat {
    float position[4], normal[4], color[4];
} splat;

static int compare_splats(const void* a, const void* b)
{
    return memcmp(a, b, sizeof(splat));
}

/* Beyond the focus, tiles may be there or not, and normals at their borders go by them */
static int is_within_reach(const float* position)
{
    const float x = position[0] - 1, y = position[1];
    return x * x + y * y < 5 * 5;
}

/* what the world shows within reach, in an order of its own; the caller frees it */
static splat* splats_of(animation* self, sr_world* world, size_t* count)
{
    const struct host* host = &self->queue.host;
    const struct host_commands commands = begin_commands(host);
    struct host_buffer read[4];
    sr_splats splats;
    splat* out;
    uint32_t n;
    int i, a;
    memset(&splats, 0, sizeof splats);
    splats.struct_size = sizeof splats;
    CHECK_OK(self->visitor->context, sr_world_get_splats(world, &splats));
    for (i = 0; i < 4; ++i) {
        const sr_array* from = i == 0   ? &splats.positions
                               : i == 1 ? &splats.normals
                               : i == 2 ? &splats.colors
                                        : &splats.blocks;
        const VkBufferCopy region = {from->offset, 0, from->bytes};
        read[i] = make_buffer(host, from->bytes);
        vkCmdCopyBuffer(commands.commands, from->buffer, read[i].buffer, 1, &region);
    }
    CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
    run_commands(host, &commands);
    vkDestroyCommandPool(host->device, commands.pool, NULL);
    out = malloc((splats.count + 1) * sizeof *out);
    *count = 0;
    for (n = 0; n < splats.count; ++n)
        if (((uint32_t*)read[3].mapped)[n / 64] && ((float*)read[0].mapped)[4 * n + 3] > 0 &&
            is_within_reach((float*)read[0].mapped + 4 * n)) {
            splat* to = &out[(*count)++];
            float* const arrays[3] = {to->position, to->normal, to->color};
            for (a = 0; a < 3; ++a)
                memcpy(arrays[a], (float*)read[a].mapped + 4 * n, 4 * sizeof(float));
        }
    qsort(out, *count, sizeof *out, compare_splats);
    for (i = 0; i < 4; ++i)
        destroy_buffer(host, &read[i]);
    return out;
}

static void check_same_labels(const uint32_t* label)
{
    int i, other = 0;
    for (i = 0; i < 2 * PIXELS; ++i)
        other += label[i] != alone.label[i];
    printf("a worker: %d of %d numbers of labels differ\n", other, 2 * PIXELS); /* of use where one does */
    CHECK(!other);
}

/* The splats of a world that one thread makes and shows at once, to the bit */
static void check_same_splats(animation* self)
{
    visitor other = *self->visitor;
    const sr_semaphore done = {self->timeline, 1u << 20};
    const struct host_commands commands = begin_commands(&self->queue.host);
    size_t count, other_count;
    splat *found, *expected;
    open_world(&other);
    for (other.done = 0; !other.done;)
        step(&other);
    CHECK_OK(other.context, sr_world_record_updates(other.world, commands.commands, &done));
    CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
    run_commands(&self->queue.host, &commands);
    vkDestroyCommandPool(self->queue.host.device, commands.pool, NULL);
    found = splats_of(self, self->visitor->world, &count);
    expected = splats_of(self, other.world, &other_count);
    CHECK(count > 1000 && count == other_count);
    CHECK(!memcmp(found, expected, count * sizeof *found));
    free(found);
    free(expected);
    sr_world_destroy(other.world);
}

static void draws_while_a_worker_steps(void)
{
    static animation a;
    pthread_t worker;
    uint64_t number = 0;
    int last, edited;
    a.visitor = &visitors[0];
    open_animation(&a);
    open_world(a.visitor);
    worker = start(work, &a);
    for (edited = 0; edited < 3; ++edited) {
        const uint64_t least = number + LEAST_FRAMES;
        if (edited)
            edit(&a, edited == 1 ? 2 : SR_NO_CELL);
        CHECK(pthread_mutex_lock(&a.queue.mutex) == 0);
        a.settled = 0;
        CHECK(pthread_mutex_unlock(&a.queue.mutex) == 0);
        while (!flag_of(&a, &a.settled) || number < least)
            animate(&a, ++number);
    }
    set_flag(&a, &a.ended);
    CHECK(pthread_join(worker, NULL) == 0);
    CHECK_OK(a.visitor->context, sr_world_step(a.visitor->world, ~0u, &a.visitor->done)); /* what was posted last */
    CHECK(a.visitor->done);
    animate(&a, ++number);
    wait_value(&a.queue.host, a.timeline, number);
    last = (int)(number % FRAMES_ON_THEIR_WAY);
    check_same_labels(a.label[last].mapped);
    check_same_splats(&a);
    printf("a worker: %u frames beside it\n", (unsigned)number);
    close_animation(&a);
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
    int i;
    for (i = 0; i < 20000; ++i) {
        const sr_status status = sr_world_flush(self->world); /* a worker's call, as a step is */
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
    draws_while_a_worker_steps();
    return 0;
}
