// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/memory.h"

#include "runtime/device/debug_names.h"
#include "runtime/device/device.h"
#include "runtime/device/exportable.h"

namespace semrover {

namespace {

constexpr VkMemoryPropertyFlags kHostSees = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

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
    if (kind == MemoryKind::staging || kind == MemoryKind::transfer) {
        const int cached = find_type(memory, allowed, kHostSees | VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
        return cached >= 0 ? cached : find_type(memory, allowed, kHostSees);
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
    b->exportable_ = kind == MemoryKind::exportable;
    SR_CHECK(b->make_handle(kind));
    SR_CHECK(b->make_memory(kind, name));
    name_object(device.vk(), device.handle(), VK_OBJECT_TYPE_BUFFER, reinterpret_cast<uint64_t>(b->buffer_), name);
    return b;
}

Status Buffer::make_handle(MemoryKind kind)
{
    auto external = vk_struct<VkExternalMemoryBufferCreateInfo>(VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO);
    external.handleTypes = VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT;
    auto info = vk_struct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, exportable_ ? &external : nullptr);
    info.size = bytes_;
    info.usage = exportable_ ? kExportedUsage : VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    if (kind == MemoryKind::device)
        info.usage |= VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT;
    if (device_.families().size() > 1 && !exportable_) {
        info.sharingMode = VK_SHARING_MODE_CONCURRENT;
        info.queueFamilyIndexCount = uint32_t(device_.families().size());
        info.pQueueFamilyIndices = device_.families().data();
    }
    SR_VK_MAKE(buffer_, device_.vk().CreateBuffer(device_.handle(), &info, device_.vk().allocator(), &buffer_));
    dedicated_ = exportable_ && needs_dedicated_memory(device_);
    return {};
}

Status Buffer::make_memory(MemoryKind kind, const char* name)
{
    VkMemoryRequirements needs;
    device_.vk().GetBufferMemoryRequirements(device_.handle(), buffer_, &needs);
    if (needs.size > device_.limits().max_allocation)
        return fail(ErrorCode::out_of_memory, "{}: {} bytes exceed the device's largest allocation of {} bytes", name,
                    needs.size, device_.limits().max_allocation);
    if (kind != MemoryKind::transfer) {
        SR_CHECK(device_.account(needs.size, name));
        accounted_ = needs.size;
    }
    VkPhysicalDeviceMemoryProperties memory;
    device_.vk().GetPhysicalDeviceMemoryProperties(device_.physical(), &memory);
    const int type = choose_type(memory, needs.memoryTypeBits, kind);
    if (type < 0)
        return fail(ErrorCode::no_device, "{}: the device has no memory type for it", name);
    const VkMemoryPropertyFlags has = memory.memoryTypes[type].propertyFlags;
    const bool staging = kind == MemoryKind::staging || kind == MemoryKind::transfer;
    const bool direct = staging || (kind == MemoryKind::device && !device_.limits().force_staging);
    const bool seen = direct && (has & kHostSees) == kHostSees;
    // staging is read as it is, where no cached memory is to be had
    cached_ = staging || has & VK_MEMORY_PROPERTY_HOST_CACHED_BIT;
    const bool borrowed = device_.memory_source().allocate && !exportable_; // an exported allocation is made for it
    return borrowed ? borrow(needs, uint32_t(type), seen, name) : allocate(needs, uint32_t(type), seen, name);
}

Status Buffer::allocate(const VkMemoryRequirements& needs, uint32_t type, bool seen, const char* name)
{
    auto alone = vk_struct<VkMemoryDedicatedAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_DEDICATED_ALLOCATE_INFO);
    alone.buffer = buffer_;
    auto exported = vk_struct<VkExportMemoryAllocateInfo>(VK_STRUCTURE_TYPE_EXPORT_MEMORY_ALLOCATE_INFO,
                                                          dedicated_ ? &alone : nullptr);
    exported.handleTypes = VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT;
    auto info =
        vk_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, exportable_ ? &exported : nullptr);
    info.allocationSize = memory_bytes_ = needs.size;
    info.memoryTypeIndex = type;
    const VulkanCalls& vk = device_.vk();
    if (vk.AllocateMemory(device_.handle(), &info, vk.allocator(), &memory_) != VK_SUCCESS) {
        memory_ = VK_NULL_HANDLE;
        return fail(ErrorCode::out_of_memory, "{}: the device refused {} bytes; {} bytes are in use", name, needs.size,
                    device_.allocated_bytes() - accounted_);
    }
    SR_VK(vk.BindBufferMemory(device_.handle(), buffer_, memory_, 0));
    if (seen)
        SR_VK_MAKE(mapped_,
                   vk.MapMemory(device_.handle(), memory_, 0, VK_WHOLE_SIZE, 0, reinterpret_cast<void**>(&mapped_)));
    return {};
}

Status Buffer::borrow(const VkMemoryRequirements& needs, uint32_t type, bool seen, const char* name)
{
    auto piece = device_.memory_source().allocate({needs.size, needs.alignment, type, seen});
    if (!piece)
        return fail(piece.error().code, "{}: {} bytes: {}", name, needs.size, piece.error().message);
    piece_ = *piece;
    if (!piece_.memory || piece_.offset % needs.alignment || (seen && !piece_.mapped))
        return fail(ErrorCode::usage,
                    "{}: the application's allocator gave no memory, not aligned to {}, or not mapped", name,
                    needs.alignment);
    mapped_ = seen ? static_cast<std::byte*>(piece_.mapped) : nullptr;
    SR_VK(device_.vk().BindBufferMemory(device_.handle(), buffer_, piece_.memory, piece_.offset));
    return {};
}

Result<int> Buffer::descriptor() const
{
    SR_ASSERT(exportable_, "a descriptor of memory that is not shared");
    auto info = vk_struct<VkMemoryGetFdInfoKHR>(VK_STRUCTURE_TYPE_MEMORY_GET_FD_INFO_KHR);
    info.memory = memory_;
    info.handleType = VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT;
    int descriptor = -1;
    SR_VK(device_.vk().GetMemoryFdKHR(device_.handle(), &info, &descriptor));
    return descriptor;
}

Buffer::~Buffer()
{
    if (memory_ || piece_.memory)
        (void)device_.wait(device_.last_ticket()); // commands in flight may use it; a lost device is reported elsewhere
    if (buffer_)
        device_.vk().DestroyBuffer(device_.handle(), buffer_, device_.vk().allocator());
    if (memory_)
        device_.vk().FreeMemory(device_.handle(), memory_, device_.vk().allocator());
    if (piece_.memory)
        device_.memory_source().release(piece_);
    device_.release(accounted_);
}

} // namespace semrover
