// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/external_copies.h"

namespace semrover {

void record_external_target(const Device& device, VkCommandBuffer commands, const BufferSlice& from,
                            const ExternalTarget& to)
{
    if (to.buffer)
        record_external_copy(device.vk(), commands, from.buffer->handle(), from.offset, to.buffer, to.offset,
                             from.bytes);
    if (to.image.image)
        record_image_copy(device.vk(), commands, from.buffer->handle(), from.offset, to.image);
}

Result<std::unique_ptr<ExternalCopies>> ExternalCopies::create(Device& device)
{
    std::unique_ptr<ExternalCopies> c(new ExternalCopies(device));
    SR_TRY(c->commands_, CommandRing::create(device, 1));
    return c;
}

Status ExternalCopies::copy(std::span<const ExternalCopy> copies)
{
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    for (const auto& [from, to] : copies)
        record_external_target(device_, commands, from, to);
    return submit();
}

Status ExternalCopies::fetch(VkBuffer from, uint64_t offset, const BufferSlice& to)
{
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    record_external_copy(device_.vk(), commands, from, offset, to.buffer->handle(), to.offset, to.bytes);
    return submit();
}

Status ExternalCopies::fetch(const ExternalImage& from, const BufferSlice& to)
{
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    record_image_fetch(device_.vk(), commands, from, to.buffer->handle(), to.offset);
    return submit();
}

Status ExternalCopies::submit()
{
    SR_TRY(const uint64_t ticket, commands_->submit());
    return device_.wait(ticket);
}

} // namespace semrover
