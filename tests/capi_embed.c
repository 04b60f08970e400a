/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A host in C: what it may get wrong, a context of its own, and a context on a device that it made itself. */
#include "tests/support/capi_vulkan.h"

static void knows_its_version(void)
{
    CHECK(sr_abi_version() == SR_ABI_VERSION);
    CHECK(strchr(sr_version(), '.'));
    CHECK(!strcmp(sr_status_name(SR_ERR_OUT_OF_MEMORY), "SR_ERR_OUT_OF_MEMORY"));
    CHECK(!strcmp(sr_status_name((sr_status)1234), "unknown"));
}

static void names_labels(void)
{
    uint8_t rgb[3] = {0, 0, 0};
    uint32_t label;
    CHECK(!strcmp(sr_class_name(0), "road") && !strcmp(sr_class_name(19), "road-lane"));
    CHECK(!sr_class_name(SR_CLASSES) && !sr_class_name(SR_NO_CELL));
    for (label = 0; label < SR_CLASSES; ++label)
        CHECK(sr_class_name(label) && sr_class_color(label, rgb) == SR_OK);
    CHECK(rgb[0] == 255 && rgb[1] == 255 && rgb[2] == 0);
    CHECK(sr_class_color(SR_CLASSES, rgb) == SR_ERR_USAGE && says(NULL, "there is no class 20"));
    CHECK(sr_class_color(0, NULL) == SR_ERR_USAGE && says(NULL, "rgb is NULL"));
}

static void lists_devices(void)
{
    uint32_t count = 0, room = 0;
    sr_device_info devices[8];
    CHECK(sr_list_devices(NULL, NULL) == SR_ERR_USAGE && says(NULL, "count is NULL"));
    CHECK(sr_list_devices(NULL, &count) == SR_OK && count > 0);
    memset(devices, 0, sizeof devices);
    room = 8;
    CHECK(sr_list_devices(devices, &room) == SR_ERR_USAGE && says(NULL, "struct_size"));
    devices[0].struct_size = sizeof devices[0];
    room = 8;
    CHECK(sr_list_devices(devices, &room) == (count > 8 ? SR_ERR_PARTIAL : SR_OK));
    CHECK(devices[0].index == 0 && devices[0].name[0] && devices[0].memory_bytes > 0);
    CHECK(devices[0].struct_size == sizeof devices[0]);
    room = 0;
    CHECK(sr_list_devices(devices, &room) == SR_ERR_PARTIAL && room == 0);
}

/* a program built against a header with less in sr_device_info: nothing behind its members is touched */
static void writes_no_more_than_an_old_program_has(void)
{
    struct {
        uint32_t struct_size, index;
        char name[256];
        unsigned char guard[64];
    } old;
    uint32_t room = 1;
    size_t i;
    memset(&old, 0x5a, sizeof old);
    old.struct_size = 264;
    sr_list_devices((sr_device_info*)(void*)&old, &room);
    CHECK(room == 1 && old.index == 0 && old.struct_size == 264 && strlen(old.name) < 256);
    for (i = 0; i < sizeof old.guard; ++i)
        CHECK(old.guard[i] == 0x5a);
}

static void refuses_wrong_descriptions(void)
{
    struct {
        sr_context_desc known;
        uint64_t newer;
    } future;
    sr_context_desc desc;
    sr_context* context = (sr_context*)&desc;
    memset(&desc, 0, sizeof desc);
    CHECK(sr_context_create(NULL, NULL) == SR_ERR_USAGE);
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "struct_size is not set") && !context);
    desc.struct_size = sizeof desc;
    desc.next = &desc;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "next is not NULL"));
    desc.next = NULL;
    desc.device = "nonesuch";
    CHECK(sr_context_create(&desc, &context) == SR_ERR_NO_DEVICE && says(NULL, "no usable device matches 'nonesuch'"));
    memset(&future, 0, sizeof future);
    future.known.struct_size = sizeof future;
    future.newer = 1;
    CHECK(sr_context_create(&future.known, &context) == SR_ERR_USAGE && says(NULL, "does not know"));
    future.newer = 0;
    CHECK(sr_context_create(&future.known, &context) == SR_OK && context);
    sr_context_destroy(context);
    sr_context_destroy(NULL);
}

static void makes_a_context_of_its_own(void)
{
    sr_context* context = NULL;
    sr_device_info device;
    sr_memory_info memory;
    sr_context_desc desc;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.max_bytes = 1 << 30;
    CHECK(sr_context_create(&desc, &context) == SR_OK);
    memset(&device, 0, sizeof device);
    CHECK(sr_context_get_device(context, &device) == SR_ERR_USAGE && says(context, "struct_size is not set"));
    device.struct_size = sizeof device;
    CHECK(sr_context_get_device(context, &device) == SR_OK && device.name[0] && !device.refusal[0]);
    memset(&memory, 0, sizeof memory);
    memory.struct_size = sizeof memory;
    CHECK(sr_context_get_memory(context, &memory) == SR_OK);
    CHECK(memory.used_bytes == 0 && memory.budget_bytes == 1 << 30);
    CHECK(sr_last_error(context, NULL, 0) > 0);
    sr_context_destroy(context);
    CHECK(sr_context_create(NULL, &context) == SR_OK);
    sr_context_destroy(context);
}

static int locks, unlocks;
static void lock_queue(void* user)
{
    locks += user == &locks;
}
static void unlock_queue(void* user)
{
    unlocks += user == &locks;
}

static void lends_its_own_device(void)
{
    const struct host host = make_host();
    sr_vulkan_device vulkan = lent(&host);
    sr_context_desc desc;
    sr_context* context = NULL;
    vulkan.robust_buffer_access = 0;
    vulkan.user = &locks;
    vulkan.lock_queue = lock_queue;
    memset(&desc, 0, sizeof desc);
    desc.struct_size = sizeof desc;
    desc.vulkan = &vulkan;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "robustBufferAccess"));
    vulkan.reserved = 1;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "reserved"));
    vulkan.reserved = 0;
    vulkan.robust_buffer_access = 1;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "both of lock and unlock"));
    vulkan.unlock_queue = unlock_queue;
    desc.device = "0";
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE &&
          says(NULL, "do not go with a device of the application's"));
    desc.device = NULL;
    vulkan.queue = NULL;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "needs instance, physical device"));
    vulkan.queue = host.queue;
    CHECK(sr_context_create(&desc, &context) == SR_OK);
    sr_context_destroy(context);
    CHECK(locks == unlocks);
    CHECK(vkDeviceWaitIdle(host.device) == VK_SUCCESS); /* still the application's */
    destroy_host(&host);
}

int main(void)
{
    sr_set_diagnostic_callback(print_line, stderr);
    knows_its_version();
    names_labels();
    lists_devices();
    writes_no_more_than_an_old_program_has();
    refuses_wrong_descriptions();
    makes_a_context_of_its_own();
    lends_its_own_device();
    return 0;
}
