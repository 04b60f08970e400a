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

// what a copy needs an image of the application's to be
struct ImageTransfer {
    const ExternalImage& image;
    VkImageLayout layout;
    VkAccessFlags access;
};

void move_image(const VulkanCalls& vk, VkCommandBuffer commands, const ImageTransfer& t, VkPipelineStageFlags from,
                VkPipelineStageFlags to, VkImageMemoryBarrier image)
{
    image.srcQueueFamilyIndex = image.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    image.image = t.image.image;
    image.subresourceRange = {t.image.aspect, 0, 1, 0, 1};
    vk.CmdPipelineBarrier(commands, from, to, 0, 0, nullptr, 0, nullptr, 1, &image);
}

void begin_transfer(const VulkanCalls& vk, VkCommandBuffer commands, const ImageTransfer& t)
{
    auto image = vk_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
    image.srcAccessMask = kAnything;
    image.dstAccessMask = t.access;
    image.oldLayout = t.image.before;
    image.newLayout = t.layout;
    move_image(vk, commands, t, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kTransfer, image);
}

void end_transfer(const VulkanCalls& vk, VkCommandBuffer commands, const ImageTransfer& t, VkAccessFlags written)
{
    auto image = vk_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
    image.srcAccessMask = written;
    image.dstAccessMask = kAnything;
    image.oldLayout = t.layout;
    image.newLayout = t.image.after;
    move_image(vk, commands, t, kTransfer, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, image);
}

VkBufferImageCopy whole_image(const ImageTransfer& t, uint64_t offset)
{
    VkBufferImageCopy region{};
    region.bufferOffset = offset;
    region.imageSubresource = {t.image.aspect, 0, 0, 1};
    region.imageExtent = {t.image.width, t.image.height, 1};
    return region;
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

void record_external_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at, VkBuffer to,
                          uint64_t to_at, uint64_t bytes)
{
    barrier(vk, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything, kTransfer,
            kCopy); // what the application did with it
    const VkBufferCopy region{from_at, to_at, bytes};
    vk.CmdCopyBuffer(commands, from, to, 1, &region);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | kHost,
            kAnything | VK_ACCESS_HOST_READ_BIT);
}

void record_image_copy(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer from, uint64_t from_at,
                       const ExternalImage& to)
{
    const ImageTransfer transfer{to, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_ACCESS_TRANSFER_WRITE_BIT};
    begin_transfer(vk, commands, transfer);
    const VkBufferImageCopy region = whole_image(transfer, from_at);
    vk.CmdCopyBufferToImage(commands, from, to.image, transfer.layout, 1, &region);
    end_transfer(vk, commands, transfer, VK_ACCESS_TRANSFER_WRITE_BIT);
}

void record_image_fetch(const VulkanCalls& vk, VkCommandBuffer commands, const ExternalImage& from, VkBuffer to,
                        uint64_t to_at)
{
    // what was read of the buffer before, too
    barrier(vk, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything, kTransfer, kCopy);
    const ImageTransfer transfer{from, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, VK_ACCESS_TRANSFER_READ_BIT};
    begin_transfer(vk, commands, transfer);
    const VkBufferImageCopy region = whole_image(transfer, to_at);
    vk.CmdCopyImageToBuffer(commands, from.image, transfer.layout, to, 1, &region);
    end_transfer(vk, commands, transfer, 0);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer, kShader | kCopy);
}

void record_entry_barrier(const VulkanCalls& vk, VkCommandBuffer commands)
{
    barrier(vk, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything, kCompute | kTransfer, kShader | kCopy);
}

void record_exit_barrier(const VulkanCalls& vk, VkCommandBuffer commands)
{
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAnything);
}

void record_fill(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint64_t at, uint64_t bytes,
                 uint32_t value)
{
    vk.CmdFillBuffer(commands, buffer, at, bytes, value);
}

void record_update(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer to, uint64_t at,
                   std::span<const std::byte> bytes)
{
    constexpr size_t kMost = 65536; // of a call
    for (size_t done = 0; done < bytes.size(); done += kMost) {
        const auto part = bytes.subspan(done, std::min(kMost, bytes.size() - done));
        vk.CmdUpdateBuffer(commands, to, at + done, part.size(), part.data());
    }
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer, kShader | kCopy);
}

void record_share(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint32_t queue_family)
{
    auto release = vk_struct<VkBufferMemoryBarrier>(VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER);
    release.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    release.srcQueueFamilyIndex = queue_family;
    release.dstQueueFamilyIndex = VK_QUEUE_FAMILY_EXTERNAL;
    release.buffer = buffer;
    release.size = VK_WHOLE_SIZE;
    vk.CmdPipelineBarrier(commands, kTransfer, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0, 0, nullptr, 1, &release, 0,
                          nullptr);
}

void record_clear(const VulkanCalls& vk, VkCommandBuffer commands, VkBuffer buffer, uint64_t at, uint64_t bytes)
{
    record_fill(vk, commands, buffer, at, bytes, 0);
    barrier(vk, commands, kTransfer, VK_ACCESS_TRANSFER_WRITE_BIT, kCompute | kTransfer | kHost,
            kShader | kCopy | VK_ACCESS_HOST_READ_BIT);
}

} // namespace semrover
