// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/command.h"

namespace semrover {

namespace {

constexpr VkPipelineStageFlags kCompute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
constexpr VkPipelineStageFlags kTransfer = VK_PIPELINE_STAGE_TRANSFER_BIT;
constexpr VkPipelineStageFlags kHost = VK_PIPELINE_STAGE_HOST_BIT;
constexpr VkAccessFlags kShader = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT;
constexpr VkAccessFlags kCopy = VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;

void barrier(const VulkanCalls& vk, VkCommandBuffer commands, VkPipelineStageFlags from, VkAccessFlags written,
             VkPipelineStageFlags to, VkAccessFlags access)
{
    auto memory = vk_struct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
    memory.srcAccessMask = written;
    memory.dstAccessMask = access;
    vk.CmdPipelineBarrier(commands, from, to, 0, 1, &memory, 0, nullptr, 0, nullptr);
}

constexpr VkAccessFlags kAnything = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;

VkImageMemoryBarrier transition(const HostImage& to)
{
    auto image = vk_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
    image.srcQueueFamilyIndex = image.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    image.image = to.image;
    image.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    return image;
}

} // namespace

Status begin_commands(const VulkanCalls& vk, VkCommandBuffer commands, bool once)
{
    auto info = vk_struct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
    info.flags = once ? VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT : VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT;
    SR_VK(vk.BeginCommandBuffer(commands, &info));
    return {};
}

void record_barrier(const VulkanCalls& vk, VkCommandBuffer commands)
{
    barrier(vk, commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, kCompute, kShader);
}

void record_final_barrier(const VulkanCalls& vk, VkCommandBuffer commands)
{
    barrier(vk, commands, kCompute, VK_ACCESS_SHADER_WRITE_BIT, kCompute | kTransfer | kHost,
            kShader | kCopy | VK_ACCESS_HOST_READ_BIT);
}

void record_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at, VkBuffer to,
                 uint64_t to_at, uint64_t bytes)
{
    const VkBufferCopy region{from_at, to_at, bytes};
    vk.CmdCopyBuffer(commands, from, to, 1, &region);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer | kHost,
            kShader | kCopy | VK_ACCESS_HOST_READ_BIT);
}

void record_host_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at, VkBuffer to,
                      uint64_t to_at, uint64_t bytes)
{
    barrier(vk, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything, kTransfer, kCopy); // what the host did with it
    const VkBufferCopy region{from_at, to_at, bytes};
    vk.CmdCopyBuffer(commands, from, to, 1, &region);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | kHost,
            kAnything | VK_ACCESS_HOST_READ_BIT);
}

void record_image_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at,
                       const HostImage& to)
{
    VkImageMemoryBarrier image = transition(to);
    image.srcAccessMask = kAnything;
    image.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    image.oldLayout = to.before;
    image.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kTransfer, 0, 0, nullptr, 0, nullptr, 1,
                          &image);
    VkBufferImageCopy region{};
    region.bufferOffset = from_at;
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = {to.width, to.height, 1};
    vk.CmdCopyBufferToImage(commands, from, to.image, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
    image.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    image.dstAccessMask = kAnything;
    image.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
    image.newLayout = to.after;
    vk.CmdPipelineBarrier(commands, kTransfer, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0, nullptr, 0, nullptr, 1,
                          &image);
}

void record_image_fetch(const VulkanCalls& vk, VkCommandBuffer commands, const HostImage& from,
                        VkImageAspectFlags aspect, VkBuffer to, uint64_t to_at)
{
    // what was read of the buffer before, too
    barrier(vk, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything, kTransfer, kCopy);
    VkImageMemoryBarrier image = transition(from);
    image.subresourceRange.aspectMask = aspect;
    image.srcAccessMask = kAnything;
    image.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
    image.oldLayout = from.before;
    image.newLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kTransfer, 0, 0, nullptr, 0, nullptr, 1,
                          &image);
    VkBufferImageCopy region{};
    region.bufferOffset = to_at;
    region.imageSubresource = {aspect, 0, 0, 1};
    region.imageExtent = {from.width, from.height, 1};
    vk.CmdCopyImageToBuffer(commands, from.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to, 1, &region);
    image.srcAccessMask = 0; // nothing is written
    image.dstAccessMask = kAnything;
    image.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    image.newLayout = from.after;
    vk.CmdPipelineBarrier(commands, kTransfer, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0, nullptr, 0, nullptr, 1,
                          &image);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer, kShader | kCopy);
}

void record_entry_barrier(const VulkanCalls& vk, VkCommandBuffer commands)
{
    barrier(vk, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything, kCompute | kTransfer, kShader | kCopy);
}

void record_update(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer to, uint64_t at,
                   std::span<const std::byte> bytes)
{
    vk.CmdUpdateBuffer(commands, to, at, bytes.size(), bytes.data());
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer, kShader | kCopy);
}

void record_clear(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint64_t at, uint64_t bytes)
{
    vk.CmdFillBuffer(commands, buffer, at, bytes, 0);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer | kHost,
            kShader | kCopy | VK_ACCESS_HOST_READ_BIT);
}

} // namespace semrover
