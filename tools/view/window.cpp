// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/window.h"

#define GLFW_INCLUDE_VULKAN
#include <algorithm>
#include <GLFW/glfw3.h>

namespace semrover::view {

namespace {

Error display_error(const char* what)
{
    const char* reason = nullptr;
    glfwGetError(&reason);
    return {ErrorCode::no_device, fmt::format("{} ({}); --screenshot needs no window", what, reason ? reason : "GLFW")};
}

void turn(VkCommandBuffer commands, VkImage image, VkImageLayout from, VkImageLayout to)
{
    VkImageMemoryBarrier barrier{};
    barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
    barrier.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
    barrier.dstAccessMask = VK_ACCESS_MEMORY_WRITE_BIT | VK_ACCESS_MEMORY_READ_BIT;
    barrier.oldLayout = from;
    barrier.newLayout = to;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image;
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0,
                         nullptr, 0, nullptr, 1, &barrier);
}

} // namespace

Result<std::unique_ptr<Window>> Window::open(uint32_t width, uint32_t height)
{
    std::unique_ptr<Window> window(new Window);
    if (!glfwInit())
        return tl::make_unexpected(display_error("no window can be opened here"));
    glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
    window->glfw_ = glfwCreateWindow(int(width), int(height), "semrover", nullptr, nullptr);
    if (!window->glfw_)
        return tl::make_unexpected(display_error("no window can be opened here"));
    return window;
}

Window::~Window()
{
    if (glfw_)
        glfwDestroyWindow(glfw_);
    glfwTerminate();
}

void Window::ask(GpuRequest& request) const
{
    request.extensions = glfwGetRequiredInstanceExtensions(&request.extension_count);
    request.make_surface = [this](VkInstance instance, VkSurfaceKHR* surface) {
        return glfwCreateWindowSurface(instance, glfw_, nullptr, surface);
    };
}

Status Window::attach(Gpu& gpu)
{
    gpu_ = &gpu;
    SR_TRY(acquired_, semaphore());
    return make_swapchain();
}

void Window::detach()
{
    if (!gpu_)
        return;
    free_swapchain();
    vkDestroySemaphore(gpu_->device(), acquired_, nullptr);
    gpu_ = nullptr;
}

bool Window::closing() const
{
    return glfwWindowShouldClose(glfw_);
}

void Window::close()
{
    glfwSetWindowShouldClose(glfw_, GLFW_TRUE);
}

void Window::poll()
{
    glfwPollEvents();
}

std::array<uint32_t, 2> Window::size() const
{
    int width = 0, height = 0;
    glfwGetFramebufferSize(glfw_, &width, &height);
    return {uint32_t(width), uint32_t(height)};
}

Result<VkSemaphore> Window::semaphore()
{
    VkSemaphoreCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO;
    VkSemaphore made = VK_NULL_HANDLE;
    SR_CHECK(checked(vkCreateSemaphore(gpu_->device(), &info, nullptr, &made), "vkCreateSemaphore"));
    return made;
}

Status Window::make_swapchain()
{
    VkSurfaceCapabilitiesKHR can;
    SR_CHECK(checked(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(gpu_->physical(), gpu_->surface(), &can),
                     "vkGetPhysicalDeviceSurfaceCapabilitiesKHR"));
    uint32_t count = 0;
    vkGetPhysicalDeviceSurfaceFormatsKHR(gpu_->physical(), gpu_->surface(), &count, nullptr);
    std::vector<VkSurfaceFormatKHR> formats(count);
    vkGetPhysicalDeviceSurfaceFormatsKHR(gpu_->physical(), gpu_->surface(), &count, formats.data());
    // eight bits a channel that are shown as they are: pictures are sRGB already
    const auto format = std::ranges::find_if(formats, [](const VkSurfaceFormatKHR& f) {
        return f.format == VK_FORMAT_B8G8R8A8_UNORM || f.format == VK_FORMAT_R8G8B8A8_UNORM;
    });
    if (format == formats.end() || !(can.supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_DST_BIT))
        return fail(ErrorCode::no_device, "this window takes no pictures of 8 bits a channel that are copied to it");
    const auto [width, height] = size();
    extent_ = can.currentExtent.width == UINT32_MAX ? VkExtent2D{width, height} : can.currentExtent;
    VkSwapchainCreateInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR;
    info.surface = gpu_->surface();
    info.minImageCount = can.minImageCount;
    info.imageFormat = format->format;
    info.imageColorSpace = format->colorSpace;
    info.imageExtent = extent_;
    info.imageArrayLayers = 1;
    info.imageUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    info.preTransform = can.currentTransform;
    info.compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
    info.presentMode = VK_PRESENT_MODE_FIFO_KHR;
    info.clipped = VK_TRUE;
    SR_CHECK(checked(vkCreateSwapchainKHR(gpu_->device(), &info, nullptr, &swapchain_), "vkCreateSwapchainKHR"));
    SR_CHECK(checked(vkGetSwapchainImagesKHR(gpu_->device(), swapchain_, &count, nullptr), "vkGetSwapchainImagesKHR"));
    images_.resize(count);
    SR_CHECK(checked(vkGetSwapchainImagesKHR(gpu_->device(), swapchain_, &count, images_.data()),
                     "vkGetSwapchainImagesKHR"));
    for (size_t n = 0; n < images_.size(); ++n) {
        SR_TRY(const VkSemaphore drawn, semaphore());
        drawn_.push_back(drawn);
    }
    return {};
}

void Window::free_swapchain()
{
    vkDeviceWaitIdle(gpu_->device());
    for (VkSemaphore drawn : drawn_)
        vkDestroySemaphore(gpu_->device(), drawn, nullptr);
    drawn_.clear();
    images_.clear();
    vkDestroySwapchainKHR(gpu_->device(), swapchain_, nullptr);
    swapchain_ = VK_NULL_HANDLE;
}

// a picture of another size, while the window's changes, is stretched
void Window::copy(VkCommandBuffer commands, const Picture& picture, VkImage to) const
{
    turn(commands, to, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    VkImageBlit region{};
    region.srcSubresource = region.dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.srcOffsets[1] = {int32_t(picture.width()), int32_t(picture.height()), 1};
    region.dstOffsets[1] = {int32_t(extent_.width), int32_t(extent_.height), 1};
    vkCmdBlitImage(commands, picture.image(), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to,
                   VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region, VK_FILTER_NEAREST);
    turn(commands, to, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_PRESENT_SRC_KHR);
}

Status Window::show(const Picture& picture, const std::function<Status(VkCommandBuffer)>& record)
{
    const auto [width, height] = size();
    if (!width || !height) // it is hidden
        return gpu_->run(record);
    uint32_t index = 0;
    VkResult result = vkAcquireNextImageKHR(gpu_->device(), swapchain_, UINT64_MAX, acquired_, VK_NULL_HANDLE, &index);
    if (result == VK_ERROR_OUT_OF_DATE_KHR) {
        free_swapchain();
        SR_CHECK(make_swapchain());
        return gpu_->run(record);
    }
    if (result != VK_SUBOPTIMAL_KHR)
        SR_CHECK(checked(result, "vkAcquireNextImageKHR"));
    const auto all = [&](VkCommandBuffer commands) -> Status {
        SR_CHECK(record(commands));
        copy(commands, picture, images_[index]);
        return {};
    };
    SR_CHECK(gpu_->run(all, acquired_, drawn_[index]));
    return present(index);
}

Status Window::present(uint32_t index)
{
    VkPresentInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_PRESENT_INFO_KHR;
    info.waitSemaphoreCount = 1;
    info.pWaitSemaphores = &drawn_[index];
    info.swapchainCount = 1;
    info.pSwapchains = &swapchain_;
    info.pImageIndices = &index;
    const VkResult result = vkQueuePresentKHR(gpu_->queue(), &info);
    if (result != VK_ERROR_OUT_OF_DATE_KHR && result != VK_SUBOPTIMAL_KHR)
        return checked(result, "vkQueuePresentKHR");
    free_swapchain();
    return make_swapchain();
}

} // namespace semrover::view
