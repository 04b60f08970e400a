// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/memory.h"

#include "runtime/device/device.h"

namespace semrover {

namespace {

// first type that has all of `wanted`; Vulkan lists the better of two equal types first
int find_type(const VkPhysicalDeviceMemoryProperties& memory, uint32_t allowed, VkMemoryPropertyFlags wanted)
{
    for (uint32_t i = 0; i < memory.memoryTypeCount; ++i)
        if ((allowed >> i & 1) && (memory.memoryTypes[i].propertyFlags & wanted) == wanted)
            return int(i);
    return -1;
}

int choose_type(const VkPhysicalDeviceMemoryProperties& memory, uint32_t allowed, MemoryKind kind)
{
    constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    if (kind != MemoryKind::device) {
        const int cached = find_type(memory, allowed, kHost | VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
        return cached >= 0 ? cached : find_type(memory, allowed, kHost);
    }
    const int local = find_type(memory, allowed, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    return local >= 0 ? local : find_type(memory, allowed, 0);
}

} // namespace

Result<std::unique_ptr<Buffer>> Buffer::create(Device& device, uint64_t bytes, MemoryKind kind, const char* name)
{
    if (bytes > device.limits().max_allocation)
        return fail(ErrorCode::out_of_memory, "{}: {} bytes exceed the device's largest allocation of {} bytes", name,
                    bytes, device.limits().max_allocation);
    std::unique_ptr<Buffer> b(new Buffer(device));
    b->bytes_ = round_up64(std::max<uint64_t>(bytes, 1), device.limits().offset_alignment);
    auto info = vk_struct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
    info.size = b->bytes_;
    info.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    if (kind == MemoryKind::device)
        info.usage |= VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT;
    SR_VK(device.vk().CreateBuffer(device.handle(), &info, nullptr, &b->buffer_));
    VkMemoryRequirements needs;
    device.vk().GetBufferMemoryRequirements(device.handle(), b->buffer_, &needs);
    if (needs.size > device.limits().max_allocation)
        return fail(ErrorCode::out_of_memory, "{}: {} bytes exceed the device's largest allocation of {} bytes", name,
                    needs.size, device.limits().max_allocation);
    if (kind != MemoryKind::transfer) {
        SR_CHECK(device.account(int64_t(needs.size), name));
        b->accounted_ = needs.size;
    }
    VkPhysicalDeviceMemoryProperties memory;
    device.vk().GetPhysicalDeviceMemoryProperties(device.physical(), &memory);
    const int type = choose_type(memory, needs.memoryTypeBits, kind);
    if (type < 0)
        return fail(ErrorCode::no_device, "{}: the device has no memory type for it", name);
    auto allocate = vk_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocate.allocationSize = needs.size;
    allocate.memoryTypeIndex = uint32_t(type);
    if (device.vk().AllocateMemory(device.handle(), &allocate, nullptr, &b->memory_) != VK_SUCCESS)
        return fail(ErrorCode::out_of_memory, "{}: the device refused {} bytes; {} bytes are in use", name, needs.size,
                    device.allocated_bytes() - b->accounted_);
    SR_VK(device.vk().BindBufferMemory(device.handle(), b->buffer_, b->memory_, 0));
    constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    const bool direct = kind != MemoryKind::device || !device.limits().force_staging;
    if (direct && (memory.memoryTypes[type].propertyFlags & kHost) == kHost)
        SR_VK(device.vk().MapMemory(device.handle(), b->memory_, 0, VK_WHOLE_SIZE, 0,
                                    reinterpret_cast<void**>(&b->mapped_)));
    // staging is read as it is, where no cached memory is to be had
    b->cached_ =
        kind != MemoryKind::device || memory.memoryTypes[type].propertyFlags & VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
    return b;
}

Buffer::~Buffer()
{
    if (memory_)
        (void)device_.wait(device_.last_ticket()); // commands in flight may use it; a lost device is told elsewhere
    if (buffer_)
        device_.vk().DestroyBuffer(device_.handle(), buffer_, nullptr);
    if (memory_)
        device_.vk().FreeMemory(device_.handle(), memory_, nullptr);
    device_.release(accounted_);
}

} // namespace semrover
