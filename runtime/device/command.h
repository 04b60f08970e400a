// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/vulkan_calls.h"

#include <cstdint>
#include <span>

// recording; the only file that emits barriers
namespace semrover {

Status begin_commands(const VulkanCalls& vk, VkCommandBuffer commands, bool once);

// every shader write before is visible to every shader access after
void record_barrier(const VulkanCalls& vk, VkCommandBuffer commands);
// the same at the end of a submit: what follows may be shaders, copies or the host
void record_final_barrier(const VulkanCalls& vk, VkCommandBuffer commands);
// with the barrier that lets shaders, copies and the host follow
void record_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at, VkBuffer to,
                 uint64_t to_at, uint64_t bytes);
// Into memory that belongs to an application: everything that follows in the queue may use it. An image has one level
// and one layer, and comes in one layout and goes in another; its whole content is replaced.
void record_external_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at, VkBuffer to,
                          uint64_t to_at, uint64_t bytes);
struct ExternalImage {
    VkImage image = VK_NULL_HANDLE;
    uint32_t width = 0, height = 0;
    VkImageLayout before = VK_IMAGE_LAYOUT_UNDEFINED, after = VK_IMAGE_LAYOUT_GENERAL;
    VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT;
};
// the other way: row by row. `before` is not UNDEFINED
void record_image_fetch(const VulkanCalls& vk, VkCommandBuffer commands, const ExternalImage& from, VkBuffer to,
                        uint64_t to_at);
void record_image_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at,
                       const ExternalImage& to);
// into a command buffer of the application's: what follows may use everything that came before, in the queue too
void record_entry_barrier(const VulkanCalls& vk, VkCommandBuffer commands);
// and out of it: everything that follows may use what was copied and filled
void record_exit_barrier(const VulkanCalls& vk, VkCommandBuffer commands);
// words of one value, without a barrier
void record_fill(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint64_t at, uint64_t bytes,
                 uint32_t value);
// bytes of the command itself: a multiple of 4; with the barrier that lets shaders follow
void record_update(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer to, uint64_t at,
                   std::span<const std::byte> bytes);
// a buffer goes to another API (MemoryKind::exportable), with all that was written to it; what overwrites it takes it
// back
void record_share(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint32_t queue_family);
void record_clear(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint64_t at, uint64_t bytes);

} // namespace semrover
