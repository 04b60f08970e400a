/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C that has draws recorded into command buffers of its own, or submitted between its semaphores; that gives
 * the library its own way to Vulkan, and keeps what drivers compile. And what it may get wrong.
 *
 *     capi_record MODEL CACHE
 *
 * CACHE: where contexts of our own keep a file. */
#include "tests/support/capi_memory.h"
#include "tests/support/capi_street.h"

#include <math.h>

enum { WIDTH = 64, HEIGHT = 40, PIXELS = WIDTH * HEIGHT };

static const char *model, *cache;

static sr_draw_desc camera(double x)
{
    return camera_at(x, WIDTH, HEIGHT);
}

static sr_world* make_world(sr_context* context, sr_world_desc* desc)
{
    sr_world* world = NULL;
    CHECK_OK(context, create_world(context, model, desc, &world));
    walk(context, world, 4, 6);
    return world;
}

/* what sr_world_draw makes of a camera */
static void draw_colors(sr_context* context, sr_world* world, double x, float* color)
{
    sr_draw_desc draw = camera(x);
    draw.color.memory = color;
    CHECK_OK(context, sr_world_draw(world, &draw));
}

static float first[PIXELS * 4], second[PIXELS * 4];
static const VkDeviceSize kBytes = sizeof first;

static void refuses_what_cannot_be_recorded(sr_context* context, sr_world* world, VkCommandBuffer commands)
{
    sr_draw_desc draw = camera(1);
    sr_semaphore none = {NULL, 1};
    sr_sync sync;
    sr_context_desc own_desc;
    sr_context* own = NULL;
    sr_world_desc desc = street_world();
    sr_world* of_own = NULL;
    memset(&sync, 0, sizeof sync);
    sync.struct_size = sizeof sync;
    CHECK(sr_world_record(NULL, &draw, commands) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_world_record(world, NULL, commands) == SR_ERR_USAGE && says(context, "NULL"));
    CHECK(sr_world_record(world, &draw, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    draw.color.memory = first;
    CHECK(sr_world_record(world, &draw, commands) == SR_ERR_USAGE && says(context, "not to memory"));
    CHECK(sr_world_submit(world, &draw, &sync) == SR_ERR_USAGE && says(context, "not to memory"));
    draw = camera(1);
    draw.height = 16385;
    CHECK(sr_world_record(world, &draw, commands) == SR_ERR_USAGE && says(context, "64 x 16385"));
    draw = camera(1);
    draw.fx = 0;
    CHECK(sr_world_record(world, &draw, commands) == SR_ERR_BAD_INPUT && says(context, "focal length"));
    CHECK(sr_world_submit(world, &draw, &sync) == SR_ERR_BAD_INPUT && says(context, "focal length"));
    draw = camera(1);
    CHECK(sr_world_submit(NULL, &draw, &sync) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    CHECK(sr_world_submit(world, &draw, NULL) == SR_ERR_USAGE && says(context, "sr_sync: NULL"));
    sync.struct_size = 0;
    CHECK(sr_world_submit(world, &draw, &sync) == SR_ERR_USAGE && says(context, "struct_size"));
    sync.struct_size = sizeof sync;
    sync.wait_count = 1;
    CHECK(sr_world_submit(world, &draw, &sync) == SR_ERR_USAGE && says(context, "waits is NULL"));
    sync.waits = &none;
    CHECK(sr_world_submit(world, &draw, &sync) == SR_ERR_USAGE && says(context, "semaphore 0 of waits"));
    sync.wait_count = 0;
    sync.reserved = 1;
    CHECK(sr_world_submit(world, &draw, &sync) == SR_ERR_USAGE && says(context, "reserved"));
    CHECK(sr_world_check_draws(NULL) == SR_ERR_USAGE && says(NULL, "world is NULL"));
    sync.reserved = 0;
    memset(&own_desc, 0, sizeof own_desc);
    own_desc.struct_size = sizeof own_desc;
    own_desc.pipeline_cache = "damaged"; /* in place of our file */
    own_desc.pipeline_cache_bytes = 8;
    CHECK_OK(NULL, sr_context_create(&own_desc, &own));
    desc.splat_bytes = 1 << 16;
    CHECK_OK(own, create_world(own, model, &desc, &of_own));
    CHECK(sr_world_record(of_own, &draw, commands) == SR_ERR_USAGE &&
          says(own, "not on a device of the application's"));
    CHECK(sr_world_submit(of_own, &draw, &sync) == SR_ERR_USAGE && says(own, "not on a device of the application's"));
    CHECK(sr_world_check_draws(of_own) == SR_OK);
    sr_world_destroy(of_own);
    sr_context_destroy(own);
    desc.splat_bytes = 0;
    CHECK_OK(context, create_world(context, model, &desc, &of_own));
    CHECK(sr_world_record(of_own, &draw, commands) == SR_ERR_USAGE && says(context, "without splat_bytes"));
    sr_world_destroy(of_own);
}

/* two draws in one command buffer, to a buffer and an image; executed twice, once behind a step that changes nothing */
static void records_draws(const struct host* host, sr_context* context, sr_world* world)
{
    struct host_buffer buffer = make_buffer(host, 2 * kBytes + 32), read = make_buffer(host, kBytes);
    struct host_image image = make_image(host, WIDTH, HEIGHT, VK_FORMAT_R32G32B32A32_SFLOAT);
    const struct host_commands commands = begin_commands(host);
    sr_draw_desc draw = camera(1);
    int time;
    refuses_what_cannot_be_recorded(context, world, commands.commands);
    draw.color.buffer = buffer.buffer;
    draw.color.buffer_offset = 32;
    CHECK_OK(context, sr_world_record(world, &draw, commands.commands));
    draw = camera(2);
    draw.color.buffer = buffer.buffer;
    draw.color.buffer_offset = 32 + kBytes;
    draw.color.image = image.image;
    draw.color.layout_before = VK_IMAGE_LAYOUT_UNDEFINED;
    draw.color.layout_after = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    CHECK_OK(context, sr_world_record(world, &draw, commands.commands));
    CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
    for (time = 0; time < 2; ++time) {
        memset(buffer.mapped, 0, 2 * kBytes + 32);
        run_commands(host, &commands);
        CHECK(!memcmp((char*)buffer.mapped + 32, first, kBytes));
        CHECK(!memcmp((char*)buffer.mapped + 32 + kBytes, second, kBytes));
        CHECK(((char*)buffer.mapped)[31] == 0);
        read_image(host, &image, &read);
        CHECK(!memcmp(read.mapped, second, kBytes));
        CHECK_OK(context, sr_world_check_draws(world));
        CHECK_OK(context, sr_world_step(world, 0, NULL));
    }
    vkDestroyCommandPool(host->device, commands.pool, NULL);
    destroy_image(host, &image);
    destroy_buffer(host, &buffer);
    destroy_buffer(host, &read);
}

/* every pixel the same, as a pass of the application's would leave it */
static struct host_image make_depth(const struct host* host, uint32_t width, uint32_t height, VkFormat format,
                                    float value)
{
    const int depth = format == VK_FORMAT_D32_SFLOAT;
    const struct host_image made = make_image(host, width, height, format);
    const struct host_commands commands = begin_commands(host);
    VkImageMemoryBarrier barrier = {0};
    VkClearDepthStencilValue z = {0};
    VkClearColorValue color = {{0}};
    z.depth = color.float32[0] = value;
    barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = made.image;
    barrier.subresourceRange.aspectMask = depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT;
    barrier.subresourceRange.levelCount = barrier.subresourceRange.layerCount = 1;
    barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    vkCmdPipelineBarrier(commands.commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0,
                         NULL, 0, NULL, 1, &barrier);
    if (depth)
        vkCmdClearDepthStencilImage(commands.commands, made.image, barrier.newLayout, &z, 1, &barrier.subresourceRange);
    else
        vkCmdClearColorImage(commands.commands, made.image, barrier.newLayout, &color, 1, &barrier.subresourceRange);
    CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
    run_commands(host, &commands);
    vkDestroyCommandPool(host->device, commands.pool, NULL);
    return made;
}

enum { NEAR = 1, FAR = 101 };

/* of a z-buffer with 0 at NEAR and 1 at FAR, in which `metres` is everywhere */
static sr_draw_desc tested_camera(const struct host_image* image, VkFormat format)
{
    sr_draw_desc draw = camera(1);
    draw.depth_test.image = image->image;
    draw.depth_test.format = format;
    draw.depth_test.layout_before = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    draw.depth_test.layout_after = VK_IMAGE_LAYOUT_GENERAL;
    draw.depth_test.scale = (double)FAR * NEAR / (NEAR - FAR);
    draw.depth_test.offset = (double)FAR / (FAR - NEAR);
    return draw;
}
static float z_of(double metres)
{
    return (float)((double)FAR / (FAR - NEAR) * (1 - NEAR / metres));
}

/* pixels with something in them; nothing lies behind the limit, and nothing changed where all lies before it */
static int check_limit(const float* color, const float* depth, const float* all_depth, double metres)
{
    int i, seen = 0;
    for (i = 0; i < PIXELS; ++i) {
        seen += color[4 * i + 3] > 0;
        CHECK(depth[2 * i] <= metres * 1.0001 && depth[2 * i + 1] <= metres * 1.0001);
        if (all_depth[2 * i] > metres * 1.5) /* the mean: something was behind */
            CHECK(color[4 * i + 3] < first[4 * i + 3]);
    }
    return seen;
}

/* against z-buffers at several distances, of both formats, waited for and recorded */
static void tests_against_the_hosts_depth(const struct host* host, sr_context* context, sr_world* world)
{
    static float color[PIXELS * 4], depth[PIXELS * 2], all_depth[PIXELS * 2];
    const double metres[4] = {100.5, 7, 3, 1.01};
    struct host_buffer buffer = make_buffer(host, kBytes);
    sr_draw_desc draw = camera(1);
    int seen[4], i;
    draw.depth.memory = all_depth;
    CHECK_OK(context, sr_world_draw(world, &draw));
    for (i = 0; i < 4; ++i) {
        const VkFormat format = i % 2 ? VK_FORMAT_R32_SFLOAT : VK_FORMAT_D32_SFLOAT;
        struct host_image image = make_depth(host, WIDTH, HEIGHT, format, z_of(metres[i]));
        const struct host_commands commands = begin_commands(host);
        draw = tested_camera(&image, format);
        draw.color.memory = color;
        draw.depth.memory = depth;
        CHECK_OK(context, sr_world_draw(world, &draw));
        seen[i] = check_limit(color, depth, all_depth, metres[i]);
        draw = tested_camera(&image, format);
        draw.depth_test.layout_before = VK_IMAGE_LAYOUT_GENERAL; /* as the draw left it */
        draw.color.buffer = buffer.buffer;
        CHECK_OK(context, sr_world_record(world, &draw, commands.commands));
        CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
        run_commands(host, &commands);
        vkDestroyCommandPool(host->device, commands.pool, NULL);
        CHECK(!memcmp(buffer.mapped, color, kBytes));
        CHECK_OK(context, sr_world_check_draws(world));
        if (i == 0)
            CHECK(!memcmp(color, first, kBytes)); /* all of it */
        destroy_image(host, &image);
    }
    CHECK(seen[0] > seen[1] && seen[1] > seen[2] && seen[2] > seen[3]);
    destroy_buffer(host, &buffer);
}

static void refuses_wrong_depth_images(sr_context* context, sr_world* world)
{
    const struct host_image none = {(VkImage)(size_t)1, VK_NULL_HANDLE, WIDTH, HEIGHT}; /* which nobody looks at */
    sr_draw_desc draw = tested_camera(&none, VK_FORMAT_D16_UNORM);
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "format 124"));
    draw = tested_camera(&none, VK_FORMAT_D32_SFLOAT);
    draw.depth_test.layout_before = VK_IMAGE_LAYOUT_UNDEFINED;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "UNDEFINED"));
    draw = tested_camera(&none, VK_FORMAT_D32_SFLOAT);
    draw.depth_test.reserved = 1;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "reserved"));
    draw = tested_camera(&none, VK_FORMAT_D32_SFLOAT);
    draw.depth_test.scale = INFINITY;
    CHECK(sr_world_draw(world, &draw) == SR_ERR_USAGE && says(context, "scale is inf"));
}

static uint64_t value_of(const struct host* host, VkSemaphore semaphore)
{
    uint64_t value = 0;
    CHECK(vkGetSemaphoreCounterValue(host->device, semaphore, &value) == VK_SUCCESS);
    return value;
}

static void signal_value(const struct host* host, VkSemaphore semaphore, uint64_t value)
{
    VkSemaphoreSignalInfo info = {0};
    info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO;
    info.semaphore = semaphore;
    info.value = value;
    CHECK(vkSignalSemaphore(host->device, &info) == VK_SUCCESS);
}

/* draws begin when the host says so, and say when they have ended; more of them than the library keeps command buffers
 */
static void waits_for_and_signals_semaphores(const struct host* host, sr_context* context, sr_world* world)
{
    struct host_buffer buffer = make_buffer(host, 2 * kBytes);
    const VkSemaphore go = make_timeline(host), done = make_timeline(host);
    const sr_semaphore waits = {go, 7}, signals[2] = {{done, 3}, {done, 5}};
    sr_draw_desc draw = camera(1);
    sr_sync sync;
    uint64_t n;
    memset(&sync, 0, sizeof sync);
    sync.struct_size = sizeof sync;
    sync.waits = &waits;
    sync.wait_count = 1;
    sync.signals = signals;
    sync.signal_count = 1;
    draw.color.buffer = buffer.buffer;
    CHECK_OK(context, sr_world_submit(world, &draw, &sync));
    draw = camera(2);
    draw.color.buffer = buffer.buffer;
    draw.color.buffer_offset = kBytes;
    sync.signals = signals + 1;
    CHECK_OK(context, sr_world_submit(world, &draw, &sync));
    signal_value(host, go, 6);
    CHECK(value_of(host, done) == 0);
    CHECK(((const float*)buffer.mapped)[4 * PIXELS - 1] == 0 && first[4 * PIXELS - 1] > 0.5f);
    signal_value(host, go, 7);
    wait_value(host, done, 5);
    CHECK(!memcmp(buffer.mapped, first, kBytes));
    CHECK(!memcmp((char*)buffer.mapped + kBytes, second, kBytes));
    for (n = 6; n < 6 + 20; ++n) {
        sr_semaphore signal;
        signal.semaphore = done;
        signal.value = n;
        draw = camera(n % 2 ? 1 : 2);
        draw.color.buffer = buffer.buffer;
        sync.wait_count = 0;
        sync.signals = &signal;
        CHECK_OK(context, sr_world_submit(world, &draw, &sync));
    }
    wait_value(host, done, n - 1);
    CHECK(!memcmp(buffer.mapped, (n - 1) % 2 ? first : second, kBytes));
    CHECK_OK(context, sr_world_check_draws(world));
    CHECK(vkQueueWaitIdle(host->queue) == VK_SUCCESS);
    vkDestroySemaphore(host->device, go, NULL);
    vkDestroySemaphore(host->device, done, NULL);
    destroy_buffer(host, &buffer);
}

/* splats that cover the whole picture touch more tiles than there is room for; the next picture is whole */
static void tells_of_splats_that_are_missing(const struct host* host, sr_context* context)
{
    static float whole[16 * PIXELS * 4];
    struct host_buffer buffer = make_buffer(host, sizeof whole);
    sr_world_desc desc = street_world();
    sr_draw_desc draw = camera(1), waited;
    sr_world* world;
    int time;
    desc.splat_radius = 0.7;
    world = make_world(context, &desc);
    draw.width *= 4;
    draw.height *= 4;
    draw.fx = draw.fy = draw.cx = draw.width / 2;
    draw.cy = draw.height / 2;
    waited = draw;
    waited.color.memory = whole;
    CHECK_OK(context, sr_world_draw(world, &waited));
    draw.color.buffer = buffer.buffer;
    for (time = 0; time < 2; ++time) {
        struct host_commands commands = begin_commands(host);
        CHECK_OK(context, sr_world_record(world, &draw, commands.commands));
        CHECK(vkEndCommandBuffer(commands.commands) == VK_SUCCESS);
        run_commands(host, &commands);
        vkDestroyCommandPool(host->device, commands.pool, NULL);
        if (time == 0) {
            CHECK(sr_world_check_draws(world) == SR_ERR_PARTIAL && says(context, "lacks splats"));
            CHECK(memcmp(buffer.mapped, whole, sizeof whole) != 0);
        }
        CHECK_OK(context, sr_world_check_draws(world)); /* there is room, and nothing was drawn since */
    }
    CHECK(!memcmp(buffer.mapped, whole, sizeof whole));
    sr_world_destroy(world);
    destroy_buffer(host, &buffer);
}

/* a first draw that lacks room is drawn again, against the same z-buffer and to the same scale */
static void draws_again_against_the_same_depth(const struct host* host, sr_context* context)
{
    enum { LARGE = 16 * PIXELS };
    static float color[2][LARGE * 4], z[2][LARGE];
    const VkFormat format = VK_FORMAT_D32_SFLOAT;
    struct host_image image = make_depth(host, 4 * WIDTH, 4 * HEIGHT, format, z_of(3));
    sr_world_desc desc = street_world();
    sr_world* world;
    int time, i, seen = 0;
    desc.splat_radius = 0.7;
    world = make_world(context, &desc);
    for (time = 0; time < 2; ++time) {
        sr_draw_desc draw = tested_camera(&image, format);
        draw.depth_test.layout_before = time ? VK_IMAGE_LAYOUT_GENERAL : VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
        draw.width *= 4;
        draw.height *= 4;
        draw.fx = draw.fy = draw.cx = draw.width / 2;
        draw.cy = draw.height / 2;
        draw.color.memory = color[time];
        draw.depth.memory = z[time];
        draw.depth.format = format;
        draw.depth_scale = draw.depth_test.scale;
        draw.depth_offset = draw.depth_test.offset;
        CHECK_OK(context, sr_world_draw(world, &draw));
    }
    CHECK(!memcmp(color[0], color[1], sizeof color[0]) && !memcmp(z[0], z[1], sizeof z[0]));
    for (i = 0; i < LARGE; ++i) {
        seen += color[0][4 * i + 3] > 0;
        CHECK(z[0][i] == 1 || z[0][i] <= z_of(3) * 1.0001f);
    }
    CHECK(seen > LARGE / 8);
    sr_world_destroy(world);
    destroy_image(host, &image);
}

/* the application's way to Vulkan, on which it counts two of the calls */
static uint64_t dispatches, submits;
static PFN_vkCmdDispatch real_dispatch;
static PFN_vkQueueSubmit real_submit;
static VKAPI_ATTR void VKAPI_CALL counted_dispatch(VkCommandBuffer commands, uint32_t x, uint32_t y, uint32_t z)
{
    ++dispatches;
    real_dispatch(commands, x, y, z);
}
static VKAPI_ATTR VkResult VKAPI_CALL counted_submit(VkQueue queue, uint32_t count, const VkSubmitInfo* infos,
                                                     VkFence fence)
{
    ++submits;
    return real_submit(queue, count, infos, fence);
}
static uint64_t locks, unlocks;
static void lock_queue(void* user)
{
    CHECK(user == &locks && locks == unlocks);
    ++locks;
}
static void unlock_queue(void* user)
{
    ++unlocks;
    CHECK(user == &locks && locks == unlocks);
}
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_call(VkDevice device, const char* name)
{
    const PFN_vkVoidFunction found = vkGetDeviceProcAddr(device, name);
    if (!strcmp(name, "vkCmdDispatch")) {
        real_dispatch = (PFN_vkCmdDispatch)found;
        return (PFN_vkVoidFunction)counted_dispatch;
    }
    if (!strcmp(name, "vkQueueSubmit")) {
        real_submit = (PFN_vkQueueSubmit)found;
        return (PFN_vkVoidFunction)counted_submit;
    }
    return found;
}
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_call(VkInstance instance, const char* name)
{
    if (!strcmp(name, "vkGetDeviceProcAddr"))
        return (PFN_vkVoidFunction)device_call;
    return vkGetInstanceProcAddr(instance, name);
}
static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL no_call(VkInstance instance, const char* name)
{
    (void)instance;
    (void)name;
    return NULL;
}

/* what drivers compiled, in the application's keeping: whole, damaged, of no driver */
static void keeps_what_drivers_compile(const struct host* host, sr_context* context)
{
    const sr_vulkan_device vulkan = lent(host);
    sr_context_desc desc;
    sr_context* again = NULL;
    uint64_t bytes = 0, room;
    unsigned char *blob, *other;
    CHECK(sr_context_get_pipeline_cache(NULL, NULL, &bytes) == SR_ERR_USAGE && says(NULL, "NULL"));
    CHECK(sr_context_get_pipeline_cache(context, NULL, NULL) == SR_ERR_USAGE && says(context, "NULL"));
    CHECK_OK(context, sr_context_get_pipeline_cache(context, NULL, &bytes));
    CHECK(bytes >= 8 + 32);
    blob = malloc((size_t)bytes);
    other = malloc((size_t)bytes);
    room = bytes - 1;
    memset(blob, 0x5a, (size_t)bytes);
    CHECK(sr_context_get_pipeline_cache(context, blob, &room) == SR_ERR_PARTIAL && says(context, "room for"));
    CHECK(room == bytes && blob[0] == 0x5a && blob[bytes - 1] == 0x5a);
    CHECK_OK(context, sr_context_get_pipeline_cache(context, blob, &room));
    CHECK(room == bytes);
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    desc.pipeline_cache = blob;
    CHECK(sr_context_create(&desc, &again) == SR_ERR_USAGE && says(NULL, "come together") && !again);
    for (desc.pipeline_cache_bytes = bytes;; desc.pipeline_cache_bytes = 7) {
        CHECK_OK(NULL, sr_context_create(&desc, &again));
        room = bytes;
        CHECK_OK(again, sr_context_get_pipeline_cache(again, other, &room));
        sr_context_destroy(again);
        if (desc.pipeline_cache_bytes == 7)
            break;
        CHECK(room == bytes && !memcmp(blob, other, (size_t)bytes)); /* all of it, before anything is compiled */
    }
    blob[bytes / 2] ^= 1;
    desc.pipeline_cache_bytes = bytes;
    CHECK_OK(NULL, sr_context_create(&desc, &again));
    sr_context_destroy(again);
    free(blob);
    free(other);
}

/* of a draw into `cameras` parts of a buffer, when all is there that it needs */
static uint64_t submits_of(const struct host_buffer* buffer, sr_context* context, sr_world* world, uint32_t cameras)
{
    sr_draw_desc draws[3];
    uint64_t before = 0;
    uint32_t i, time;
    for (time = 0; time < 3; ++time) { /* the second one is measured */
        for (i = 0; i < cameras; ++i) {
            draws[i] = camera(1 + i);
            draws[i].color.buffer = buffer->buffer;
            draws[i].color.buffer_offset = i * kBytes;
        }
        before = submits;
        CHECK_OK(context, sr_world_draws(world, draws, cameras));
    }
    return submits - before;
}

static void takes_the_hosts_way_to_vulkan(const struct host* host)
{
    sr_vulkan_device vulkan = lent(host);
    sr_context_desc desc;
    sr_context* context = NULL;
    sr_world_desc world_desc = street_world();
    sr_world* world;
    struct host_buffer buffer;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    vulkan.get_instance_proc_addr = no_call;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_NO_DEVICE && says(NULL, "this Vulkan has no vk") && !context);
    vulkan.get_instance_proc_addr = instance_call;
    vulkan.lock_queue = lock_queue;
    vulkan.unlock_queue = unlock_queue;
    vulkan.user = &locks;
    context = adopt(&vulkan);
    world = make_world(context, &world_desc);
    CHECK(dispatches > 100 && submits > 10);
    draw_colors(context, world, 1, first);
    CHECK(first[4 * PIXELS - 1] > 0.5f);
    buffer = make_buffer(host, 3 * kBytes);
    CHECK(submits_of(&buffer, context, world, 3) == submits_of(&buffer, context, world, 1));
    destroy_buffer(host, &buffer);
    keeps_what_drivers_compile(host, context);
    sr_world_destroy(world);
    sr_context_destroy(context);
    CHECK(locks == submits && unlocks == submits); /* around each of them */
}

int main(int argc, char** argv)
{
    struct host host;
    sr_context* context;
    sr_world_desc desc;
    sr_world* world;
    CHECK(argc == 3);
    model = argv[1];
    cache = argv[2];
    sr_set_diagnostic_callback(print_line, stderr);
    host = make_host();
    takes_the_hosts_way_to_vulkan(&host);
    context = adopt_host(&host);
    desc = street_world();
    world = make_world(context, &desc);
    draw_colors(context, world, 1, first);
    draw_colors(context, world, 2, second);
    CHECK(memcmp(first, second, kBytes) != 0);
    records_draws(&host, context, world);
    waits_for_and_signals_semaphores(&host, context, world);
    refuses_wrong_depth_images(context, world);
    tests_against_the_hosts_depth(&host, context, world);
    sr_world_destroy(world);
    tells_of_splats_that_are_missing(&host, context);
    draws_again_against_the_same_depth(&host, context);
    sr_context_destroy(context);
    destroy_host(&host);
    CHECK(!fopen(cache, "r")); /* nothing is kept but what the host keeps */
    return 0;
}
