// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/semrover_vulkan.h"
#include "tools/view/shading.h"

#include <vector>

struct ImDrawData;

namespace semrover::view {

// A picture of one size: what the library draws (colour, normal, depth, label), the refined frame, and the image that
// is made of them, which a window shows and files get.
class Picture {
  public:
    static Result<std::unique_ptr<Picture>> create(Gpu& gpu, Shading& shading, uint32_t width, uint32_t height);
    ~Picture();

    uint32_t width() const { return width_; }
    uint32_t height() const { return height_; }
    VkImage image() const { return image_->handle; }

    void aim(sr_draw_desc& draw) const; // its targets
    sr_target refined() const;          // where a renderer's frame goes

    // shades what was drawn, with panels over it; leaves the image to be copied from
    void record(VkCommandBuffer commands, Look look, ImDrawData* panels) const;

    // of the last picture that was made: r, g, b row by row; metres along z of a pixel, 0 where nothing is
    Result<std::vector<uint8_t>> read();
    Result<float> depth_at(uint32_t x, uint32_t y);

  private:
    Picture(Gpu& gpu, Shading& shading, uint32_t width, uint32_t height)
        : gpu_(gpu), shading_(shading), width_(width), height_(height)
    {
    }
    Status make_buffers();
    Status make_image();

    Gpu& gpu_;
    Shading& shading_;
    uint32_t width_, height_;
    std::unique_ptr<Buffer> color_, normal_, depth_, label_, instance_, refined_, palette_, copied_;
    std::unique_ptr<Image> image_;
    VkFramebuffer framebuffer_ = VK_NULL_HANDLE;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
};

} // namespace semrover::view
