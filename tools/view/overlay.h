// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/view/gpu.h"

struct GLFWwindow;
struct ImDrawData;

namespace semrover::view {

// Dear ImGui on the viewer's device. One at a time.
class Overlay {
  public:
    // window: whose mouse and keys it hears; nullptr: none
    static Result<std::unique_ptr<Overlay>> create(Gpu& gpu, VkRenderPass pass, GLFWwindow* window);
    ~Overlay();

    void begin(uint32_t width, uint32_t height); // of the picture; panels follow
    ImDrawData* end();

  private:
    Overlay(Gpu& gpu, GLFWwindow* window) : gpu_(gpu), window_(window) {}
    Status open(VkRenderPass pass);

    Gpu& gpu_;
    GLFWwindow* window_;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    bool window_heard_ = false, drawn_ = false;
};

} // namespace semrover::view
