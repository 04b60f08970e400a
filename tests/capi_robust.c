/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * An application in C whose device has VK_EXT_pipeline_robustness enabled in place of robustBufferAccess. Where the
 * driver does not have it, 77 says so.
 *
 *     capi_robust MODEL */
#include "tests/support/capi_street.h"

enum { WIDTH = 24, HEIGHT = 16 };

static int has_pipeline_robustness(void)
{
    VkInstance instance = make_instance(0);
    VkPhysicalDevice physical;
    VkExtensionProperties all[512];
    uint32_t devices = 1, count = 512, i;
    int has = 0;
    vkEnumeratePhysicalDevices(instance, &devices, &physical);
    CHECK(devices == 1);
    CHECK(vkEnumerateDeviceExtensionProperties(physical, NULL, &count, all) == VK_SUCCESS);
    for (i = 0; i < count; ++i)
        has = has || !strcmp(all[i].extensionName, VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME);
    vkDestroyInstance(instance, NULL);
    return has;
}

static void draws(sr_context* context, const char* model)
{
    static float color[WIDTH * HEIGHT * 4];
    sr_world_desc desc = street_world();
    sr_draw_desc picture = camera_at(1, WIDTH, HEIGHT);
    sr_world* world = NULL;
    picture.color.memory = color;
    CHECK_OK(context, create_world(context, model, &desc, &world));
    walk(context, world, 1, 0.5);
    CHECK_OK(context, sr_world_draw(world, &picture));
    CHECK(color[4 * WIDTH * HEIGHT - 1] > 0.5f);
    sr_world_destroy(world);
}

int main(int argc, char** argv)
{
    sr_context_desc desc = SR_INIT(sr_context_desc);
    sr_context* context = NULL;
    sr_vulkan_device vulkan;
    struct host host;
    CHECK(argc == 2);
    sr_set_diagnostic_callback(print_line, stderr);
    if (!has_pipeline_robustness()) {
        puts("SKIP: no VK_EXT_pipeline_robustness");
        return 77;
    }
    host = make_host_with(VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME);
    vulkan = lent(&host);
    vulkan.robust_buffer_access = 0;
    desc.vulkan = &vulkan;
    CHECK(sr_context_create(&desc, &context) == SR_ERR_USAGE && says(NULL, "needs robustBufferAccess or pipeline"));
    vulkan.pipeline_robustness = 1;
    CHECK_OK(NULL, sr_context_create(&desc, &context));
    draws(context, argv[1]);
    sr_context_destroy(context);
    destroy_host(&host);
    return 0;
}
