// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/staging.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace semrover {

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

Status Staging::read(const BufferSlice& from, std::span<std::byte> bytes)
{
    struct Copy {
        uint64_t ticket = 0;
        BufferSlice half;
        std::byte* to = nullptr;
    };
    Copy last; // still to be emptied
    size_t index = 0;
    const auto empty = [&](const Copy& copy) -> Status {
        SR_CHECK(device_.wait(copy.ticket));
        if (copy.to)
            std::memcpy(copy.to, window_->mapped() + copy.half.offset, copy.half.bytes);
        return {};
    };
    for (uint64_t at = 0; at < bytes.size(); at += half_bytes(), ++index) {
        const uint64_t count = std::min<uint64_t>(half_bytes(), bytes.size() - at);
        Copy next{0, half(index, count), bytes.data() + at};
        SR_TRY(next.ticket, copies_->copy(from.part(at, count), next.half));
        SR_CHECK(empty(last));
        last = next;
    }
    return empty(last);
}

} // namespace semrover
