// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/host_copies.h"

namespace semrover {

Result<std::unique_ptr<HostCopies>> HostCopies::create(Device& device)
{
    std::unique_ptr<HostCopies> c(new HostCopies(device));
    auto pool = vk_struct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
    pool.queueFamilyIndex = device.queue_family();
    pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
    SR_VK(vkCreateCommandPool(device.handle(), &pool, nullptr, &c->pool_));
    auto allocate = vk_struct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    allocate.commandPool = c->pool_;
    allocate.commandBufferCount = 1;
    SR_VK(vkAllocateCommandBuffers(device.handle(), &allocate, &c->commands_));
    return c;
}

HostCopies::~HostCopies()
{
    (void)device_.wait(device_.last_ticket()); // a lost device is told elsewhere
    if (pool_)
        vkDestroyCommandPool(device_.handle(), pool_, nullptr);
}

Status HostCopies::copy(const BufferSlice& from, const HostTarget& to)
{
    SR_CHECK(begin_commands(commands_, true));
    if (to.buffer)
        record_host_copy(commands_, from.buffer->handle(), from.offset, to.buffer, to.offset, from.bytes);
    if (to.image.image)
        record_image_copy(commands_, from.buffer->handle(), from.offset, to.image);
    return submit();
}

Status HostCopies::fetch(VkBuffer from, uint64_t offset, const BufferSlice& to)
{
    SR_CHECK(begin_commands(commands_, true));
    record_host_copy(commands_, from, offset, to.buffer->handle(), to.offset, to.bytes);
    return submit();
}

Status HostCopies::submit()
{
    SR_VK(vkEndCommandBuffer(commands_));
    SR_TRY(const uint64_t ticket, device_.submit({&commands_, 1}));
    return device_.wait(ticket);
}

} // namespace semrover
