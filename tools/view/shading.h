// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/view/gpu.h"

#include <array>
#include <cstdint>

namespace semrover::view {

enum class Shown : uint32_t { color, depth, normal, labels, cells, refined, instances }; // numbers as in picture.frag
constexpr std::array<const char*, 7> kShownNames = {"color", "depth",   "normal",   "labels",
                                                    "cells", "refined", "instances"};

// push constants of picture.frag
struct Look {
    std::array<float, 12> world_to_camera{};
    std::array<float, 4> lens{};    // fx, fy, cx, cy
    std::array<uint32_t, 2> size{}; // pixels
    Shown shown = Shown::color;
    int32_t brush = -1; // voxels around the marked one; -1: none is marked
    std::array<int32_t, 3> marked{};
    float voxel = 0.6f; // metres
    float range = 15;   // metres, at which the depth picture has faded to a third
};

// The buffers that picture.frag reads, by binding.
constexpr uint32_t kShadedBuffers = 7;

// How a picture is made of what the library draws: render pass and pipeline, for pictures of any size.
class Shading {
  public:
    static Result<std::unique_ptr<Shading>> create(Gpu& gpu);
    ~Shading();

    VkRenderPass pass() const { return pass_; } // one attachment, left to be copied from
    Result<VkDescriptorSet> set(const std::array<VkBuffer, kShadedBuffers>& buffers);   // one at a time
    void record(VkCommandBuffer commands, VkDescriptorSet set, const Look& look) const; // inside the pass

  private:
    explicit Shading(Gpu& gpu) : gpu_(gpu) {}
    Status make_pass();
    Status make_set_layout();
    Status make_pipeline();

    Gpu& gpu_;
    VkRenderPass pass_ = VK_NULL_HANDLE;
    VkDescriptorSetLayout set_layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

} // namespace semrover::view
