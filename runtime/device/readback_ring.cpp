// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/device/readback_ring.h"

namespace semrover {

Result<std::unique_ptr<ReadbackRing>> ReadbackRing::create(Device& device, uint64_t bytes, size_t count)
{
    SR_ASSERT(count > 0, "a ring of no read-backs");
    std::unique_ptr<ReadbackRing> r(new ReadbackRing(device));
    SR_TRY(r->copies_, CopyRing::create(device, count));
    for (size_t i = 0; i < count; ++i) {
        SR_TRY(r->staging_.emplace_back(), Buffer::create(device, bytes, MemoryKind::staging, "read-backs"));
    }
    return r;
}

uint64_t ReadbackRing::planned_bytes(const DeviceLimits& limits, uint64_t bytes, size_t count)
{
    return count * round_up64(std::max<uint64_t>(bytes, 1), limits.offset_alignment);
}

Status ReadbackRing::read(const DeviceTensor& slot, Sink sink)
{
    const BufferSlice from = slot.slice();
    SR_ASSERT(from.bytes <= staging_[0]->bytes(), "'{}' of {} bytes read through {}", slot.name(), from.bytes,
              staging_[0]->bytes());
    if (reads_.size() == staging_.size())
        SR_CHECK(deliver());
    const size_t place = next_++ % staging_.size();
    SR_TRY(const uint64_t ticket, copies_->copy(from, staging_[place]->slice().part(0, from.bytes)));
    reads_.push_back({ticket, from.bytes, place, std::move(sink)});
    return {};
}

Status ReadbackRing::deliver()
{
    SR_CHECK(device_.wait(reads_.front().ticket));
    const Read read = std::move(reads_.front());
    reads_.pop_front();
    device_.count_read(read.bytes);
    return read.sink({staging_[read.place]->mapped(), read.bytes});
}

Status ReadbackRing::poll()
{
    while (!reads_.empty()) {
        SR_TRY(const bool arrived, device_.finished(reads_.front().ticket));
        if (!arrived)
            return {};
        SR_CHECK(deliver());
    }
    return {};
}

Status ReadbackRing::drain()
{
    while (!reads_.empty())
        SR_CHECK(deliver());
    return {};
}

} // namespace semrover
