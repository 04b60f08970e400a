// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/copy_ring.h"

#include "runtime/device/command.h"

#include <algorithm>
#include <array>
#include <cstring>

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

Result<std::unique_ptr<Staging>> Staging::create(Device& device, uint64_t bytes)
{
    std::unique_ptr<Staging> s(new Staging(device));
    SR_TRY(s->window_, Buffer::create(device, bytes, MemoryKind::transfer, "staging"));
    SR_TRY(s->copies_, CopyRing::create(device, kHalves));
    return s;
}

BufferSlice Staging::half(size_t index, uint64_t bytes) const
{
    return {window_.get(), index % kHalves * half_bytes(), bytes};
}

Status Staging::write(const BufferSlice& to, std::span<const std::byte> bytes)
{
    std::array<uint64_t, kHalves> tickets{}; // of the copies out of each half
    size_t index = 0;
    for (uint64_t at = 0; at < bytes.size(); at += half_bytes(), ++index) {
        const uint64_t count = std::min<uint64_t>(half_bytes(), bytes.size() - at);
        const BufferSlice from = half(index, count);
        SR_CHECK(device_.wait(tickets[index % kHalves]));
        std::memcpy(window_->mapped() + from.offset, bytes.data() + at, count);
        SR_TRY(tickets[index % kHalves], copies_->copy(from, to.part(at, count)));
    }
    return device_.wait(*std::ranges::max_element(tickets));
}

Status Staging::read(std::span<const BufferSlice> from, const PieceSink& sink)
{
    struct Copy {
        uint64_t ticket = 0;
        BufferSlice half; // of no bytes: there is none
        size_t slice = 0;
        uint64_t at = 0;
    };
    Copy last; // still to be handed over
    size_t index = 0;
    const auto hand_over = [&](const Copy& copy) -> Status {
        if (!copy.half.bytes)
            return {};
        SR_CHECK(device_.wait(copy.ticket));
        sink({copy.slice, copy.at, {window_->mapped() + copy.half.offset, copy.half.bytes}});
        return {};
    };
    for (size_t i = 0; i < from.size(); ++i)
        for (uint64_t at = 0; at < from[i].bytes; at += half_bytes(), ++index) {
            const uint64_t count = std::min<uint64_t>(half_bytes(), from[i].bytes - at);
            Copy next{0, half(index, count), i, at};
            SR_TRY(next.ticket, copies_->copy(from[i].part(at, count), next.half));
            SR_CHECK(hand_over(last));
            last = next;
        }
    return hand_over(last);
}

} // namespace semrover
