/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C that gives the library its allocators: VkAllocationCallbacks, and one of device memory. All that was
 * allocated comes back. An allocator that has nothing at its n-th call, for every n of a short run, ends a call with a
 * status and a line, and nothing is lost.
 *
 *     capi_allocators MODEL */
#include "tests/support/capi_street.h"

enum { WIDTH = 24, HEIGHT = 16, PIXELS = WIDTH * HEIGHT, MOST_CALLS = 100000 };

static const char* model;
static struct host host;

/* calls of either allocator since arm(); the one that fails; 0: none */
static uint64_t calls_made, failing_call;
static int failed;
static uint64_t objects, pieces, pieces_bytes; /* that are out */
static uint64_t objects_ever, pieces_ever;

/* A command buffer is being recorded. vkCmd.. return nothing, and Debian 12's lavapipe (22.3.6) drops a command that it
 * has no memory for without a word: vkEndCommandBuffer succeeds. So memory for commands is always there. */
static int recording;

static void arm(uint64_t n)
{
    recording = 0;
    calls_made = 0;
    failing_call = n;
    failed = 0;
}

static int refuses(void)
{
    if (recording)
        return 0;
    if (++calls_made != failing_call)
        return 0;
    failed = 1;
    return 1;
}

/* what lies before an object: its size, and where malloc began */
struct head {
    void* begin;
    size_t bytes;
};

static struct head* head_of(void* object)
{
    return (struct head*)object - 1;
}

static VKAPI_ATTR void* VKAPI_CALL allocate_object(void* user, size_t bytes, size_t alignment,
                                                   VkSystemAllocationScope scope)
{
    char* begin;
    size_t at;
    (void)scope;
    CHECK(user == &objects);
    if (refuses())
        return NULL;
    begin = malloc(bytes + alignment + sizeof(struct head));
    CHECK(begin);
    at = ((size_t)begin + sizeof(struct head) + alignment - 1) / alignment * alignment;
    head_of((void*)at)->begin = begin;
    head_of((void*)at)->bytes = bytes;
    ++objects;
    ++objects_ever;
    return (void*)at;
}

static VKAPI_ATTR void VKAPI_CALL free_object(void* user, void* object)
{
    CHECK(user == &objects);
    if (!object)
        return;
    --objects;
    free(head_of(object)->begin);
}

static VKAPI_ATTR void* VKAPI_CALL reallocate_object(void* user, void* object, size_t bytes, size_t alignment,
                                                     VkSystemAllocationScope scope)
{
    void* made;
    if (!object)
        return allocate_object(user, bytes, alignment, scope);
    if (!bytes) {
        free_object(user, object);
        return NULL;
    }
    made = allocate_object(user, bytes, alignment, scope);
    if (!made)
        return NULL;
    memcpy(made, object, bytes < head_of(object)->bytes ? bytes : head_of(object)->bytes);
    free_object(user, object);
    return made;
}

static const VkAllocationCallbacks callbacks = {&objects, allocate_object, reallocate_object, free_object, NULL, NULL};

/* every piece begins within its VkDeviceMemory, as those of a real allocator do */
static sr_status allocate_memory(void* user, const sr_memory_request* request, sr_memory_piece* piece)
{
    VkMemoryAllocateInfo info = {0};
    VkDeviceMemory memory = VK_NULL_HANDLE;
    CHECK(user == &pieces && request->struct_size == sizeof *request && request->bytes && request->alignment);
    CHECK(!piece->memory && !piece->mapped && !piece->handle);
    if (refuses())
        return SR_ERR_OUT_OF_MEMORY;
    info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
    info.allocationSize = request->bytes + request->alignment;
    info.memoryTypeIndex = request->memory_type;
    CHECK(vkAllocateMemory(host.device, &info, NULL, &memory) == VK_SUCCESS);
    piece->memory = memory;
    piece->offset = request->alignment;
    if (request->mapped) {
        CHECK(vkMapMemory(host.device, memory, 0, VK_WHOLE_SIZE, 0, &piece->mapped) == VK_SUCCESS);
        piece->mapped = (char*)piece->mapped + piece->offset;
    }
    piece->handle = malloc(sizeof(uint64_t));
    *(uint64_t*)piece->handle = request->bytes;
    pieces_bytes += request->bytes;
    ++pieces;
    ++pieces_ever;
    return SR_OK;
}

static void free_memory(void* user, const sr_memory_piece* piece)
{
    CHECK(user == &pieces && pieces > 0);
    --pieces;
    pieces_bytes -= *(uint64_t*)piece->handle;
    free(piece->handle);
    vkFreeMemory(host.device, (VkDeviceMemory)piece->memory, NULL);
}

static PFN_vkBeginCommandBuffer real_begin;
static PFN_vkEndCommandBuffer real_end;
static VKAPI_ATTR VkResult VKAPI_CALL begin_commands(VkCommandBuffer commands, const VkCommandBufferBeginInfo* info)
{
    const VkResult result = real_begin(commands, info);
    recording = result == VK_SUCCESS;
    return result;
}
static VKAPI_ATTR VkResult VKAPI_CALL end_commands(VkCommandBuffer commands)
{
    recording = 0;
    return real_end(commands);
}
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_call(VkDevice device, const char* name)
{
    const PFN_vkVoidFunction found = vkGetDeviceProcAddr(device, name);
    if (!strcmp(name, "vkBeginCommandBuffer")) {
        real_begin = (PFN_vkBeginCommandBuffer)found;
        return (PFN_vkVoidFunction)begin_commands;
    }
    if (!strcmp(name, "vkEndCommandBuffer")) {
        real_end = (PFN_vkEndCommandBuffer)found;
        return (PFN_vkVoidFunction)end_commands;
    }
    return found;
}
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_call(VkInstance instance, const char* name)
{
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (PFN_vkVoidFunction)device_call;
    return vkGetInstanceProcAddr(instance, name);
}

static sr_vulkan_device vulkan_of_host(void)
{
    sr_vulkan_device vulkan = lent(&host);
    vulkan.get_instance_proc_addr = instance_call;
    vulkan.user = &pieces;
    vulkan.allocate_memory = allocate_memory;
    vulkan.free_memory = free_memory;
    return vulkan;
}

static sr_status make_context(sr_context** context)
{
    const sr_vulkan_device vulkan = vulkan_of_host();
    sr_context_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    desc.allocation_callbacks = &callbacks;
    return sr_context_create(&desc, context);
}

static int has_line(const sr_context* context)
{
    char line[512];
    return sr_last_error(context, line, sizeof line) > 0 && !strchr(line, '\n');
}

/* a status that tells what happened, and its line */
static void check_refusal(const sr_context* context, sr_status status, uint64_t n)
{
    char line[512] = "";
    sr_last_error(context, line, sizeof line);
    if (status == SR_ERR_OUT_OF_MEMORY && has_line(context))
        return;
    fprintf(stderr, "call %lu of the allocators had nothing: %s, \"%s\"\n", (unsigned long)n, sr_status_name(status),
            line);
    exit(1);
}

static float color[PIXELS * 4], expected[PIXELS * 4];

/* a few voxels, generated and drawn: the smallest run that allocates everything. The first call that fails ends it */
static sr_status run(sr_context* context, sr_grid* grid, sr_world** world)
{
    const double position[3] = {1, 0, 1.5}, forward[3] = {1, 0, 0};
    sr_world_desc desc = street_world();
    sr_draw_desc draw = camera_at(-1, WIDTH, HEIGHT);
    uint32_t done = 0;
    sr_status status;
    desc.labels = NULL;
    desc.grid = grid;
    desc.steps = 1;
    desc.splat_bytes = 1 << 18;
    status = create_world(context, model, &desc, world);
    if (status != SR_OK) {
        CHECK(!*world);
        return status;
    }
    CHECK_OK(context, sr_world_focus(*world, position, forward, 1));
    while (!done) {
        status = sr_world_step(*world, 3600000000u, &done);
        if (status != SR_OK)
            return status;
    }
    draw.color.memory = color;
    return sr_world_draw(*world, &draw);
}

static sr_grid* few_cells(void)
{
    sr_cell cells[4];
    sr_grid* grid = NULL;
    int i;
    for (i = 0; i < 4; ++i) {
        cells[i].i = i;
        cells[i].j = cells[i].k = 0;
        cells[i].label = 0;
    }
    CHECK(sr_grid_create(0.6, &grid) == SR_OK && sr_grid_set_cells(grid, cells, 4) == SR_OK);
    return grid;
}

static void refuses_half_an_allocator(void)
{
    sr_vulkan_device vulkan = vulkan_of_host();
    sr_context_desc desc;
    sr_context* context = NULL;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    vulkan.free_memory = NULL;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "both of allocate_memory and free_memory"));
}

static void contexts_are_refused_at_every_call(void)
{
    sr_context* context = NULL;
    uint64_t n;
    for (n = 1; n < MOST_CALLS; ++n) {
        sr_status status;
        arm(n);
        status = make_context(&context);
        if (status == SR_OK)
            break;
        CHECK(failed && !context);
        check_refusal(NULL, status, n);
        CHECK(objects == 0 && pieces == 0);
    }
    CHECK(!failed && n > 3);
    sr_context_destroy(context);
    CHECK(objects == 0 && pieces == 0);
    printf("contexts: %lu calls\n", (unsigned long)n - 1);
}

/* What is compiled stays with the context, so that later runs get further. Whatever failed, the world can go on, or
 * another be made; the picture is that of the first run. */
static void worlds_are_refused_at_every_call(sr_context* context, sr_grid* grid)
{
    sr_world* world = NULL;
    uint64_t n, in_steps = 0;
    for (n = 1; n < MOST_CALLS; ++n) {
        sr_status status;
        arm(n);
        status = run(context, grid, &world);
        if (status == SR_OK)
            break;
        CHECK(failed);
        check_refusal(context, status, n);
        if (world)
            ++in_steps;
        sr_world_destroy(world);
        world = NULL;
        CHECK(pieces == 0 && pieces_bytes == 0);
    }
    CHECK(!failed && in_steps > 0);
    CHECK(!memcmp(color, expected, sizeof color));
    sr_world_destroy(world);
    printf("worlds: %lu calls refused, %lu of them in steps and draws\n", (unsigned long)n - 1,
           (unsigned long)in_steps);
}

/* a step that had no memory is taken again */
static void a_step_is_taken_again(sr_context* context, sr_grid* grid, uint64_t calls_of_a_run)
{
    const double position[3] = {1, 0, 1.5}, forward[3] = {1, 0, 0};
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    uint32_t done = 0;
    uint64_t n;
    int refused = 0;
    desc.labels = NULL;
    desc.grid = grid;
    desc.steps = 1;
    desc.splat_bytes = 1 << 18;
    arm(0);
    CHECK_OK(context, create_world(context, model, &desc, &world));
    CHECK_OK(context, sr_world_focus(world, position, forward, 1));
    for (n = 1; !done && n <= calls_of_a_run;) { /* an error begins the tile again: so n does not begin again */
        sr_status status;
        arm(n);
        status = sr_world_step(world, 0, &done);
        if (status == SR_OK)
            continue;
        check_refusal(context, status, n);
        ++refused;
        ++n;
    }
    CHECK(done && refused > 0);
    arm(0);
    walk(context, world, 1, 1); /* it is all there */
    sr_world_destroy(world);
    printf("steps: %d refused\n", refused);
}

int main(int argc, char** argv)
{
    sr_context* context = NULL;
    sr_world* world = NULL;
    sr_grid* grid;
    uint64_t calls_of_a_run;
    CHECK(argc == 2);
    model = argv[1];
    sr_set_diagnostic_callback(print_line, stderr);
    host = make_host();
    grid = few_cells();
    refuses_half_an_allocator();
    contexts_are_refused_at_every_call();

    /* all of it once, which balances */
    arm(0);
    CHECK_OK(NULL, make_context(&context));
    CHECK_OK(context, run(context, grid, &world));
    calls_of_a_run = calls_made;
    memcpy(expected, color, sizeof expected);
    CHECK(objects > 0 && pieces > 0 && objects_ever > 100 && pieces_ever > 3);
    sr_world_destroy(world);
    CHECK(pieces <= 1); /* the context's window for copies, where the host cannot see the memory */
    sr_context_destroy(context);
    CHECK(objects == 0 && pieces == 0 && pieces_bytes == 0);
    printf("a run: %lu calls\n", (unsigned long)calls_of_a_run);
    fflush(stdout);

    context = NULL;
    world = NULL;
    arm(0);
    CHECK_OK(NULL, make_context(&context));
    worlds_are_refused_at_every_call(context, grid);
    a_step_is_taken_again(context, grid, calls_of_a_run);
    sr_context_destroy(context);
    CHECK(objects == 0 && pieces == 0);
    sr_grid_destroy(grid);
    CHECK(vkDeviceWaitIdle(host.device) == VK_SUCCESS);
    destroy_host(&host);
    return 0;
}
