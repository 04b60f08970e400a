// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/outgoing.h"

#include <cstring>

namespace semrover {

namespace {

constexpr size_t kReads = 4; // on their way at a time

std::vector<uint32_t> words_of(std::span<const std::byte> bytes)
{
    std::vector<uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    return words;
}

} // namespace

Outgoing::Outgoing(std::unique_ptr<ReadbackRing> ring, uint32_t threads) : ring_(std::move(ring)), files_(threads) {}

Result<std::unique_ptr<Outgoing>> Outgoing::create(Device& device, uint64_t bytes, uint32_t threads)
{
    SR_TRY(auto ring, ReadbackRing::create(device, bytes, kReads));
    return std::unique_ptr<Outgoing>(new Outgoing(std::move(ring), threads));
}

uint64_t Outgoing::planned_bytes(const DeviceLimits& limits, uint64_t bytes)
{
    return ReadbackRing::planned_bytes(limits, bytes, kReads);
}

Status Outgoing::read(const FrameSlots& slots, const ImageSize& size, std::function<Status(FramePixels)> sink)
{
    const auto pixels = std::make_shared<FramePixels>(FramePixels{.width = size.width, .height = size.height});
    const auto into = [&](std::vector<uint32_t> FramePixels::*part) {
        return [pixels, part](std::span<const std::byte> bytes) -> Status {
            (*pixels).*part = words_of(bytes);
            return {};
        };
    };
    SR_CHECK(ring_->read(slots.seen, into(&FramePixels::seen)));
    SR_CHECK(ring_->read(slots.depths, into(&FramePixels::depths)));
    if (slots.instances.valid())
        SR_CHECK(ring_->read(slots.instances, into(&FramePixels::instances)));
    if (slots.flow.flow.valid()) {
        SR_CHECK(ring_->read(slots.flow.flow, into(&FramePixels::flow)));
        SR_CHECK(ring_->read(slots.flow.states, into(&FramePixels::flow_states)));
    }
    return ring_->read(slots.normals, [pixels, sink = std::move(sink)](std::span<const std::byte> bytes) {
        pixels->normals = words_of(bytes);
        return sink(std::move(*pixels));
    });
}

Status Outgoing::drain()
{
    const Status arrived = ring_->drain();
    const Status written = files_.drain();
    return arrived ? written : arrived;
}

} // namespace semrover
