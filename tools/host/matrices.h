/* SPDX-FileCopyrightText: semrover authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What a device needs for the library to use its matrix units (sr_vulkan_device.cooperative_matrix). Large networks run
 * several times as fast on them. */
#ifndef HOST_MATRICES_H
#define HOST_MATRICES_H

#include <vulkan/vulkan.h>

enum { MATRIX_EXTENSIONS = 2 };

struct matrices {
    int enabled;                               /* the device has all of it; 0: leave `chain` out */
    const char* extensions[MATRIX_EXTENSIONS]; /* for VkDeviceCreateInfo */
    void* chain;                               /* features, likewise; they lie in this struct, which must not move */
#ifdef VK_KHR_cooperative_matrix               /* Vulkan's headers from 1.3.255 on */
    VkPhysicalDeviceSubgroupSizeControlFeatures subgroups;
    VkPhysicalDeviceCooperativeMatrixFeaturesKHR matrix;
#endif
};

/* features: those of Vulkan 1.2 that the host enables; where there are matrix units, what they need of these is set */
void matrices_ask(struct matrices* matrices, VkPhysicalDevice physical, VkPhysicalDeviceVulkan12Features* features);

#endif
