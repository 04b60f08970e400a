// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/copy_ring.h"

#include "runtime/device/command.h"

namespace semrover {

Result<std::unique_ptr<CopyRing>> CopyRing::create(Device& device, size_t count)
{
    std::unique_ptr<CopyRing> r(new CopyRing(device));
    auto pool = vk_struct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
    pool.queueFamilyIndex = device.queue_family();
    pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    SR_VK(vkCreateCommandPool(device.handle(), &pool, nullptr, &r->pool_));
    r->commands_.resize(count);
    r->tickets_.assign(count, 0);
    auto allocate = vk_struct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    allocate.commandPool = r->pool_;
    allocate.commandBufferCount = uint32_t(count);
    SR_VK(vkAllocateCommandBuffers(device.handle(), &allocate, r->commands_.data()));
    return r;
}

CopyRing::~CopyRing()
{
    for (uint64_t ticket : tickets_)
        (void)device_.wait(ticket); // a lost device is told elsewhere
    if (pool_)
        vkDestroyCommandPool(device_.handle(), pool_, nullptr);
}

Result<uint64_t> CopyRing::copy(const BufferSlice& from, const BufferSlice& to)
{
    SR_ASSERT(from.buffer && to.buffer && from.bytes == to.bytes && from.bytes, "{} bytes copied to {}", from.bytes,
              to.bytes);
    const size_t i = next_++ % commands_.size();
    SR_CHECK(device_.wait(tickets_[i]));
    SR_CHECK(begin_commands(commands_[i], true));
    record_copy(commands_[i], from.buffer->handle(), from.offset, to.buffer->handle(), to.offset, from.bytes);
    SR_VK(vkEndCommandBuffer(commands_[i]));
    SR_TRY(tickets_[i], device_.submit({&commands_[i], 1}));
    return tickets_[i];
}

} // namespace semrover
