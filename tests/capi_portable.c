/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * An application in C that ships what it generated: a cache that one device filled, read by another. A layer gives the
 * second device its name.
 *
 *     capi_portable MODEL FOLDER fill|find */
#include "tests/support/capi_street.h"

static const char *model, *folder;

/* a world with that cache, walked through */
static sr_world_info walked(sr_context* context, uint32_t portable)
{
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    sr_world_info info;
    desc.cache = folder;
    desc.portable_cache = portable;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 2, 2);
    CHECK_OK(context, sr_world_flush(world));
    info = world_info(world);
    CHECK(info.finished == info.wanted && info.wanted > 0);
    sr_world_destroy(world);
    return info;
}

static void fill(sr_context* context)
{
    char command[1024];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    CHECK(system(command) == 0);
    CHECK(walked(context, 0).generated > 0);
    CHECK(walked(context, 0).generated == 0);
    CHECK(walked(context, 1).generated > 0); /* whose bytes another device may have made */
    CHECK(walked(context, 1).generated == 0);
    CHECK(walked(context, 0).generated == 0);
}

static void find(sr_context* context)
{
    sr_device_info device = SR_INIT(sr_device_info);
    sr_world_info info;
    CHECK_OK(context, sr_context_get_device(context, &device));
    CHECK(!strcmp(device.name, "another GPU") && strstr(device.driver, "another version"));
    info = walked(context, 1);
    CHECK(info.generated == 0 && info.loaded > 0);
    info = walked(context, 0);
    CHECK(info.generated > 0 && info.loaded == 0);
}

static void refuses_what_is_neither_0_nor_1(sr_context* context)
{
    sr_world_desc desc = street_world();
    sr_world* world = NULL;
    desc.portable_cache = 2;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE && says(context, "portable_cache is 2"));
    desc.portable_cache = 0;
    desc.reserved = 1;
    CHECK(create_world(context, model, &desc, &world) == SR_ERR_USAGE && says(context, "reserved") && !world);
}

int main(int argc, char** argv)
{
    sr_context* context = NULL;
    CHECK(argc == 4);
    model = argv[1];
    folder = argv[2];
    sr_set_diagnostic_callback(print_line, stderr);
    CHECK_OK(NULL, sr_context_create(NULL, &context));
    refuses_what_is_neither_0_nor_1(context);
    if (!strcmp(argv[3], "fill"))
        fill(context);
    else
        find(context);
    sr_context_destroy(context);
    return 0;
}
