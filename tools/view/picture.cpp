// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/picture.h"

#include <backends/imgui_impl_vulkan.h>
#include <cstring>

namespace semrover::view {

Result<std::unique_ptr<Picture>> Picture::create(Gpu& gpu, Shading& shading, uint32_t width, uint32_t height)
{
    std::unique_ptr<Picture> picture(new Picture(gpu, shading, width, height));
    SR_CHECK(picture->make_buffers());
    SR_CHECK(picture->make_image());
    return picture;
}

Picture::~Picture()
{
    vkDestroyFramebuffer(gpu_.device(), framebuffer_, nullptr);
}

Status Picture::make_buffers()
{
    const VkDeviceSize pixels = VkDeviceSize(width_) * height_;
    const VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    SR_TRY(color_, gpu_.buffer(pixels * 16, usage, false));
    SR_TRY(normal_, gpu_.buffer(pixels * 16, usage, false));
    SR_TRY(depth_, gpu_.buffer(pixels * 8, usage, false));
    SR_TRY(label_, gpu_.buffer(pixels * 8, usage, false));
    SR_TRY(refined_, gpu_.buffer(pixels * 4, usage, false));
    SR_TRY(instance_, gpu_.buffer(pixels * 4, usage, false));
    SR_TRY(copied_, gpu_.buffer(pixels * 4, usage, true));
    SR_TRY(palette_, gpu_.buffer(SR_CLASSES * 16, usage, true));
    auto* colors = static_cast<float*>(palette_->mapped);
    for (uint32_t label = 0; label < SR_CLASSES; ++label) {
        uint8_t rgb[3];
        SR_CHECK(checked(sr_class_color(label, rgb), gpu_.context()));
        for (uint32_t c = 0; c < 3; ++c)
            colors[4 * label + c] = float(rgb[c]) / 255;
    }
    SR_TRY(set_, shading_.set({color_->handle, normal_->handle, depth_->handle, label_->handle, refined_->handle,
                               palette_->handle, instance_->handle}));
    return {};
}

Status Picture::make_image()
{
    SR_TRY(image_, gpu_.image(width_, height_, VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT));
    VkFramebufferCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO;
    info.renderPass = shading_.pass();
    info.attachmentCount = 1;
    info.pAttachments = &image_->view;
    info.width = width_;
    info.height = height_;
    info.layers = 1;
    return checked(vkCreateFramebuffer(gpu_.device(), &info, nullptr, &framebuffer_), "vkCreateFramebuffer");
}

void Picture::aim(sr_draw_desc& draw) const
{
    draw.width = width_;
    draw.height = height_;
    draw.color.buffer = color_->handle;
    draw.normal.buffer = normal_->handle;
    draw.depth.buffer = depth_->handle;
    draw.label.buffer = label_->handle;
    draw.instance.buffer = instance_->handle;
}

sr_target Picture::refined() const
{
    sr_target target{};
    target.buffer = refined_->handle;
    return target;
}

void Picture::record(VkCommandBuffer commands, Look look, ImDrawData* panels) const
{
    look.size = {width_, height_};
    VkRenderPassBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
    begin.renderPass = shading_.pass();
    begin.framebuffer = framebuffer_;
    begin.renderArea = {{0, 0}, {width_, height_}};
    vkCmdBeginRenderPass(commands, &begin, VK_SUBPASS_CONTENTS_INLINE);
    shading_.record(commands, set_, look);
    if (panels)
        ImGui_ImplVulkan_RenderDrawData(panels, commands);
    vkCmdEndRenderPass(commands);
}

namespace {

// so that the host reads what was copied
void show_host(VkCommandBuffer commands)
{
    VkMemoryBarrier seen{};
    seen.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
    seen.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    seen.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &seen, 0, nullptr,
                         0, nullptr);
}

} // namespace

Result<std::vector<uint8_t>> Picture::read()
{
    SR_CHECK(gpu_.run([this](VkCommandBuffer commands) -> Status {
        VkBufferImageCopy region{};
        region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
        region.imageExtent = {width_, height_, 1};
        vkCmdCopyImageToBuffer(commands, image(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, copied_->handle, 1, &region);
        show_host(commands);
        return {};
    }));
    const auto* pixels = static_cast<const uint8_t*>(copied_->mapped);
    std::vector<uint8_t> rgb;
    rgb.reserve(size_t(width_) * height_ * 3);
    for (size_t n = 0; n < size_t(width_) * height_; ++n)
        rgb.insert(rgb.end(), pixels + 4 * n, pixels + 4 * n + 3);
    return rgb;
}

Result<float> Picture::depth_at(uint32_t x, uint32_t y)
{
    const VkDeviceSize median = (VkDeviceSize(y) * width_ + x) * 8 + 4;
    SR_CHECK(gpu_.run([this, median](VkCommandBuffer commands) -> Status {
        const VkBufferCopy region{median, 0, 4};
        vkCmdCopyBuffer(commands, depth_->handle, copied_->handle, 1, &region);
        show_host(commands);
        return {};
    }));
    float metres = 0;
    std::memcpy(&metres, copied_->mapped, 4);
    return metres;
}

} // namespace semrover::view
