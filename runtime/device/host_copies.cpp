// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/host_copies.h"

namespace semrover {

void record_host_target(const Device& device, VkCommandBuffer commands, const BufferSlice& from, const HostTarget& to)
{
    if (to.buffer)
        record_host_copy(device.vk(), commands, from.buffer->handle(), from.offset, to.buffer, to.offset, from.bytes);
    if (to.image.image)
        record_image_copy(device.vk(), commands, from.buffer->handle(), from.offset, to.image);
}

Result<std::unique_ptr<HostCopies>> HostCopies::create(Device& device)
{
    std::unique_ptr<HostCopies> c(new HostCopies(device));
    SR_TRY(c->commands_, CommandRing::create(device, 1));
    return c;
}

Status HostCopies::copy(std::span<const HostCopy> copies)
{
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    for (const auto& [from, to] : copies)
        record_host_target(device_, commands, from, to);
    return submit();
}

Status HostCopies::fetch(VkBuffer from, uint64_t offset, const BufferSlice& to)
{
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    record_host_copy(device_.vk(), commands, from, offset, to.buffer->handle(), to.offset, to.bytes);
    return submit();
}

Status HostCopies::fetch(const HostImage& from, const BufferSlice& to)
{
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    record_image_fetch(device_.vk(), commands, from, to.buffer->handle(), to.offset);
    return submit();
}

Status HostCopies::submit()
{
    SR_TRY(const uint64_t ticket, commands_->submit());
    return device_.wait(ticket);
}

} // namespace semrover
