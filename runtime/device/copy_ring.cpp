// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/copy_ring.h"

#include "runtime/device/command.h"

namespace semrover {

Result<std::unique_ptr<CopyRing>> CopyRing::create(Device& device, size_t count)
{
    std::unique_ptr<CopyRing> r(new CopyRing(device));
    SR_TRY(r->commands_, CommandRing::create(device, count));
    return r;
}

Result<uint64_t> CopyRing::copy(const BufferSlice& from, const BufferSlice& to)
{
    SR_ASSERT(from.buffer && to.buffer && from.bytes == to.bytes && from.bytes, "{} bytes copied to {}", from.bytes,
              to.bytes);
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    record_copy(device_.vk(), commands, from.buffer->handle(), from.offset, to.buffer->handle(), to.offset, from.bytes);
    return commands_->submit();
}

} // namespace semrover
