/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0 */
#include "matrices.h"

#include <string.h>

#ifdef VK_KHR_cooperative_matrix

enum { MOST_EXTENSIONS = 512 };

static int has_extension(VkPhysicalDevice physical, const char* name)
{
    static VkExtensionProperties all[MOST_EXTENSIONS];
    uint32_t count = MOST_EXTENSIONS, i;
    vkEnumerateDeviceExtensionProperties(physical, NULL, &count, all);
    for (i = 0; i < count; ++i)
        if (!strcmp(all[i].extensionName, name))
            return 1;
    return 0;
}

/* asks the device; what it answers is what is enabled */
static int has_features(struct matrices* m, VkPhysicalDevice physical)
{
    VkPhysicalDeviceVulkan12Features have = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                             .pNext = &m->matrix};
    VkPhysicalDeviceFeatures2 all = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &have};
    m->subgroups.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES;
    m->matrix.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_COOPERATIVE_MATRIX_FEATURES_KHR;
    m->matrix.pNext = &m->subgroups;
    vkGetPhysicalDeviceFeatures2(physical, &all);
    m->matrix.cooperativeMatrixRobustBufferAccess = VK_FALSE; /* not needed */
    return m->matrix.cooperativeMatrix && m->subgroups.subgroupSizeControl && m->subgroups.computeFullSubgroups &&
           have.shaderFloat16 && have.vulkanMemoryModel && have.vulkanMemoryModelDeviceScope;
}

void matrices_ask(struct matrices* m, VkPhysicalDevice physical, VkPhysicalDeviceVulkan12Features* features)
{
    memset(m, 0, sizeof *m);
    m->extensions[0] = VK_KHR_COOPERATIVE_MATRIX_EXTENSION_NAME;
    m->extensions[1] = VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME;
    if (!has_extension(physical, m->extensions[0]) || !has_extension(physical, m->extensions[1]) ||
        !has_features(m, physical))
        return;
    m->enabled = 1;
    m->chain = &m->matrix;
    features->shaderFloat16 = VK_TRUE;
    features->vulkanMemoryModel = VK_TRUE;
    features->vulkanMemoryModelDeviceScope = VK_TRUE;
}

#else

void matrices_ask(struct matrices* m, VkPhysicalDevice physical, VkPhysicalDeviceVulkan12Features* features)
{
    (void)physical;
    (void)features;
    memset(m, 0, sizeof *m);
}

#endif
