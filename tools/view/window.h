// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/view/gpu.h"
#include "tools/view/picture.h"

struct GLFWwindow;
struct ImDrawData;

namespace semrover::view {

// A window of GLFW's, and the swapchain that shows pictures in it. One at a time.
class Window {
  public:
    static Result<std::unique_ptr<Window>> open(uint32_t width, uint32_t height); // no_device: no display
    ~Window();

    void ask(GpuRequest& request) const; // for what the window needs of a device
    Status attach(Gpu& gpu);             // before the first picture; the gpu outlives what it made: see detach
    void detach();                       // before the gpu goes

    GLFWwindow* glfw() const { return glfw_; }
    bool closing() const;
    void close();
    void poll();                          // mouse and keys
    std::array<uint32_t, 2> size() const; // pixels; 0: hidden
    Status show(const Picture& picture, const std::function<Status(VkCommandBuffer)>& record);

  private:
    Window() = default;
    Status make_swapchain();
    void free_swapchain();
    Result<VkSemaphore> semaphore();
    Status present(uint32_t index);
    void copy(VkCommandBuffer commands, const Picture& picture, VkImage to) const;

    GLFWwindow* glfw_ = nullptr;
    Gpu* gpu_ = nullptr;
    VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
    VkExtent2D extent_{};
    std::vector<VkImage> images_;
    std::vector<VkSemaphore> drawn_; // of the image: may be shown
    VkSemaphore acquired_ = VK_NULL_HANDLE;
};

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
