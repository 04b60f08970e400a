// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/view/window.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_vulkan.h>
#include <imgui.h>

namespace semrover::view {

Result<std::unique_ptr<Overlay>> Overlay::create(Gpu& gpu, VkRenderPass pass, GLFWwindow* window)
{
    std::unique_ptr<Overlay> overlay(new Overlay(gpu, window));
    SR_CHECK(overlay->open(pass));
    return overlay;
}

Overlay::~Overlay()
{
    if (drawn_)
        ImGui_ImplVulkan_Shutdown();
    if (window_heard_)
        ImGui_ImplGlfw_Shutdown();
    if (ImGui::GetCurrentContext())
        ImGui::DestroyContext();
    vkDestroyDescriptorPool(gpu_.device(), pool_, nullptr);
}

Status Overlay::open(VkRenderPass pass)
{
    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 4};
    VkDescriptorPoolCreateInfo pool{};
    pool.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    pool.flags = VK_DESCRIPTOR_POOL_CREATE_FREE_DESCRIPTOR_SET_BIT;
    pool.maxSets = size.descriptorCount;
    pool.poolSizeCount = 1;
    pool.pPoolSizes = &size;
    SR_CHECK(checked(vkCreateDescriptorPool(gpu_.device(), &pool, nullptr, &pool_), "vkCreateDescriptorPool"));

    ImGui::CreateContext();
    ImGui::GetIO().IniFilename = nullptr; // no file of ours
    ImGui::StyleColorsDark();
    ImGui::GetStyle().WindowRounding = 4;
    if (window_)
        window_heard_ = ImGui_ImplGlfw_InitForVulkan(window_, true);
    ImGui_ImplVulkan_InitInfo info{};
    info.Instance = gpu_.instance();
    info.PhysicalDevice = gpu_.physical();
    info.Device = gpu_.device();
    info.QueueFamily = gpu_.family();
    info.Queue = gpu_.queue();
    info.DescriptorPool = pool_;
    info.MinImageCount = info.ImageCount = 2;
    info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
    drawn_ = ImGui_ImplVulkan_Init(&info, pass);
    SR_CHECK(gpu_.run([](VkCommandBuffer commands) -> Status {
        if (!ImGui_ImplVulkan_CreateFontsTexture(commands))
            return fail(ErrorCode::no_device, "Dear ImGui cannot make its font's texture");
        return {};
    }));
    ImGui_ImplVulkan_DestroyFontUploadObjects();
    return {};
}

void Overlay::begin(uint32_t width, uint32_t height)
{
    ImGui_ImplVulkan_NewFrame();
    if (window_) {
        ImGui_ImplGlfw_NewFrame();
    } else {
        ImGui::GetIO().DisplaySize = {float(width), float(height)};
        ImGui::GetIO().DeltaTime = 1.f / 30;
    }
    ImGui::NewFrame();
}

ImDrawData* Overlay::end()
{
    ImGui::Render();
    return ImGui::GetDrawData();
}

} // namespace semrover::view
