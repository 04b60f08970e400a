// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/command_ring.h"

#include "runtime/device/command.h"

namespace semrover {

Result<std::unique_ptr<CommandRing>> CommandRing::create(Device& device, size_t count)
{
    std::unique_ptr<CommandRing> r(new CommandRing(device));
    auto pool = vk_struct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
    pool.queueFamilyIndex = device.queue_family();
    pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    SR_VK_MAKE(r->pool_, device.vk().CreateCommandPool(device.handle(), &pool, device.vk().allocator(), &r->pool_));
    r->commands_.resize(count);
    r->tickets_.assign(count, 0);
    auto allocate = vk_struct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    allocate.commandPool = r->pool_;
    allocate.commandBufferCount = uint32_t(count);
    SR_VK(device.vk().AllocateCommandBuffers(device.handle(), &allocate, r->commands_.data()));
    return r;
}

CommandRing::~CommandRing()
{
    for (uint64_t ticket : tickets_)
        (void)device_.wait(ticket); // a lost device is reported elsewhere
    if (pool_)
        device_.vk().DestroyCommandPool(device_.handle(), pool_, device_.vk().allocator());
}

Result<VkCommandBuffer> CommandRing::begin()
{
    SR_CHECK(device_.wait(tickets_[next_]));
    if (std::exchange(open_, true))
        SR_VK(device_.vk().ResetCommandBuffer(commands_[next_], 0));
    SR_CHECK(begin_commands(device_.vk(), commands_[next_], true));
    return commands_[next_];
}

Result<uint64_t> CommandRing::submit(const TimelinePoints& points)
{
    open_ = false;
    SR_VK(device_.vk().EndCommandBuffer(commands_[next_]));
    SR_TRY(tickets_[next_], device_.submit({&commands_[next_], 1}, points));
    return tickets_[std::exchange(next_, (next_ + 1) % commands_.size())];
}

} // namespace semrover
