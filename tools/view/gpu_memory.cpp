// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// buffers and images of the viewer's own
#include "tools/view/gpu.h"

namespace semrover::view {

Buffer::~Buffer()
{
    vkDestroyBuffer(device, handle, nullptr);
    vkFreeMemory(device, memory, nullptr);
}

Image::~Image()
{
    vkDestroyImageView(device, view, nullptr);
    vkDestroyImage(device, handle, nullptr);
    vkFreeMemory(device, memory, nullptr);
}

Result<VkDeviceMemory> Gpu::allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags wanted)
{
    VkPhysicalDeviceMemoryProperties types;
    vkGetPhysicalDeviceMemoryProperties(physical_, &types);
    for (uint32_t type = 0; type < types.memoryTypeCount; ++type) {
        const bool fits = needs.memoryTypeBits >> type & 1;
        if (!fits || (types.memoryTypes[type].propertyFlags & wanted) != wanted)
            continue;
        VkMemoryAllocateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
        info.allocationSize = needs.size;
        info.memoryTypeIndex = type;
        VkDeviceMemory memory = VK_NULL_HANDLE;
        SR_CHECK(checked(vkAllocateMemory(device_, &info, nullptr, &memory), "vkAllocateMemory"));
        return memory;
    }
    return fail(ErrorCode::no_device, "this device has no type of memory for the viewer's pictures");
}

Result<std::unique_ptr<Buffer>> Gpu::buffer(VkDeviceSize bytes, VkBufferUsageFlags usage, bool mapped)
{
    auto made = std::make_unique<Buffer>();
    made->device = device_;
    VkBufferCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
    info.size = bytes;
    info.usage = usage;
    SR_CHECK(checked(vkCreateBuffer(device_, &info, nullptr, &made->handle), "vkCreateBuffer"));
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device_, made->handle, &needs);
    const VkMemoryPropertyFlags seen = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    SR_TRY(made->memory, allocate(needs, mapped ? seen : 0));
    SR_CHECK(checked(vkBindBufferMemory(device_, made->handle, made->memory, 0), "vkBindBufferMemory"));
    if (mapped)
        SR_CHECK(checked(vkMapMemory(device_, made->memory, 0, VK_WHOLE_SIZE, 0, &made->mapped), "vkMapMemory"));
    return made;
}

Result<std::unique_ptr<Image>> Gpu::image(uint32_t width, uint32_t height, VkImageUsageFlags usage)
{
    auto made = std::make_unique<Image>();
    made->device = device_;
    VkImageCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    info.imageType = VK_IMAGE_TYPE_2D;
    info.format = VK_FORMAT_R8G8B8A8_UNORM;
    info.extent = {width, height, 1};
    info.mipLevels = info.arrayLayers = 1;
    info.samples = VK_SAMPLE_COUNT_1_BIT;
    info.usage = usage;
    SR_CHECK(checked(vkCreateImage(device_, &info, nullptr, &made->handle), "vkCreateImage"));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(device_, made->handle, &needs);
    SR_TRY(made->memory, allocate(needs, 0));
    SR_CHECK(checked(vkBindImageMemory(device_, made->handle, made->memory, 0), "vkBindImageMemory"));
    VkImageViewCreateInfo view{};
    view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    view.image = made->handle;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = info.format;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    SR_CHECK(checked(vkCreateImageView(device_, &view, nullptr, &made->view), "vkCreateImageView"));
    return made;
}

} // namespace semrover::view
