// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/staging.h"

#include "runtime/device/command.h"

#include <algorithm>
#include <cstring>

namespace semrover {

Result<std::unique_ptr<Staging>> Staging::create(Device& device, uint64_t bytes)
{
    std::unique_ptr<Staging> s(new Staging(device));
    SR_TRY(s->window_, Buffer::create(device, bytes, MemoryKind::transfer, "staging"));
    SR_TRY(s->commands_, CommandRing::create(device, kHalves));
    return s;
}

// of the current half
BufferSlice Staging::part(uint64_t at, uint64_t bytes) const
{
    return {window_.get(), half_ * half_bytes() + at, bytes};
}

Status Staging::begin_half()
{
    used_ = 0;
    return device_.wait(tickets_[half_]);
}

Result<std::span<std::byte>> Staging::room(const BufferSlice& to)
{
    SR_ASSERT(to.bytes <= half_bytes(), "{} bytes in {} of staging", to.bytes, half_bytes());
    if (used_ + to.bytes > half_bytes())
        SR_CHECK(flush());
    if (pending_.empty())
        SR_CHECK(begin_half());
    const BufferSlice from = part(used_, to.bytes);
    pending_.push_back({from, to});
    used_ = round_up64(used_ + to.bytes, 16);
    return std::span(window_->mapped() + from.offset, to.bytes);
}

Status Staging::flush()
{
    if (pending_.empty())
        return {};
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    for (const Copy& copy : pending_)
        record_copy(device_.vk(), commands, copy.from.buffer->handle(), copy.from.offset, copy.to.buffer->handle(),
                    copy.to.offset, copy.to.bytes);
    pending_.clear();
    SR_TRY(tickets_[half_], commands_->submit());
    half_ = (half_ + 1) % kHalves;
    return {};
}

Status Staging::write(const BufferSlice& to, std::span<const std::byte> bytes)
{
    for (uint64_t at = 0; at < bytes.size(); at += half_bytes()) {
        const uint64_t count = std::min<uint64_t>(half_bytes(), bytes.size() - at);
        SR_TRY(const std::span<std::byte> to_fill, room(to.part(at, count)));
        std::memcpy(to_fill.data(), bytes.data() + at, count);
    }
    return flush();
}

Status Staging::clear(const BufferSlice& slice)
{
    // fills are whole words: the bytes before and after them are copied
    static constexpr std::byte kZeros[4]{};
    const uint64_t end = slice.offset + slice.bytes, begin = std::min(round_up64(slice.offset, 4), end);
    const uint64_t tail = std::max(end / 4 * 4, begin);
    SR_CHECK(write(slice.part(0, begin - slice.offset), {kZeros, begin - slice.offset}));
    SR_CHECK(write(slice.part(tail - slice.offset, end - tail), {kZeros, end - tail}));
    if (begin == tail)
        return {};
    SR_TRY(const VkCommandBuffer commands, commands_->begin());
    record_clear(device_.vk(), commands, slice.buffer->handle(), begin, tail - begin);
    return commands_->submit().map([](uint64_t) {});
}

Status Staging::read(std::span<const BufferSlice> from, const PieceSink& sink)
{
    struct Piece {
        uint64_t ticket = 0;
        BufferSlice half; // of no bytes: there is none
        size_t slice = 0;
        uint64_t at = 0;
    };
    SR_CHECK(flush());
    Piece last; // still to be handed over
    const auto hand_over = [&](const Piece& piece) -> Status {
        if (!piece.half.bytes)
            return {};
        SR_CHECK(device_.wait(piece.ticket));
        sink({piece.slice, piece.at, {window_->mapped() + piece.half.offset, piece.half.bytes}});
        return {};
    };
    for (size_t i = 0; i < from.size(); ++i)
        for (uint64_t at = 0; at < from[i].bytes; at += half_bytes()) {
            const uint64_t count = std::min<uint64_t>(half_bytes(), from[i].bytes - at);
            SR_CHECK(begin_half());
            Piece next{0, part(0, count), i, at};
            SR_TRY(const VkCommandBuffer commands, commands_->begin());
            record_copy(device_.vk(), commands, from[i].buffer->handle(), from[i].offset + at,
                        next.half.buffer->handle(), next.half.offset, count);
            SR_TRY(next.ticket, commands_->submit());
            tickets_[half_] = next.ticket;
            half_ = (half_ + 1) % kHalves;
            SR_CHECK(hand_over(last));
            last = next;
        }
    return hand_over(last);
}

} // namespace semrover
