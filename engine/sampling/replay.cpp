// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/replay.h"

#include <cstddef>
#include <cstring>

namespace semrover {

namespace {

constexpr size_t kInFlight = 3; // submits ahead of the device

// of saved bytes; x and x0 follow. In the machine's own byte order: they are taken up on the machine that wrote them.
struct SavedRun {
    char magic[8] = {'s', 'r', 'r', 'e', 'p', 'l', 'a', 'y'};
    uint64_t version = 1;
    uint64_t key = 0;
    uint64_t row = 0, rows = 0;
    uint64_t bytes = 0; // of x and of x0
};

} // namespace

// a CPU gains nothing from rows ahead, and a run that is stopped would wait for them
size_t Replay::ahead() const
{
    return device_.limits().type == DeviceType::cpu || device_.profile() ? 0 : kInFlight;
}

Status Replay::set_clock(uint32_t row)
{
    const BufferSlice word = memory_.clock.slice().part(offsetof(StepClock, row), sizeof(row));
    return device_.write(word, std::as_bytes(std::span(&row, 1)));
}

Status Replay::begin(uint32_t first)
{
    SR_CHECK(cancel());
    SR_CHECK(memory_.x.clear(device_));
    SR_CHECK(memory_.x0.clear(device_));
    SR_CHECK(set_clock(0));
    first_ = first;
    row_ = 0;
    active_ = true;
    return {};
}

Result<bool> Replay::step(size_t submits)
{
    SR_ASSERT(active_, "a step of a run that has not begun, or has ended");
    for (; submits > 0 && row_ < rows_; --submits) {
        SR_TRY(Program * program, row_program_(row_));
        SR_TRY(const uint64_t ticket, program->submit());
        ++row_;
        flight_.push_back(ticket);
        if (flight_.size() > ahead()) {
            SR_CHECK(device_.wait(flight_.front()));
            flight_.pop_front();
            SR_CHECK(program->collect_profile());
        }
    }
    if (row_ < rows_)
        return false;
    if (!flight_.empty())
        SR_CHECK(device_.wait(flight_.back()));
    flight_.clear();
    return true;
}

Status Replay::cancel()
{
    active_ = false;
    const uint64_t last = flight_.empty() ? 0 : flight_.back();
    flight_.clear();
    return device_.wait(last);
}

Result<std::vector<std::byte>> Replay::save(uint64_t key)
{
    SR_ASSERT(active_, "a run is saved that has not begun, or has ended");
    const SavedRun head{.key = key, .row = row_, .rows = rows_, .bytes = memory_.x.bytes()};
    std::vector<std::byte> saved(sizeof(head));
    std::memcpy(saved.data(), &head, sizeof(head));
    for (const Slot& slot : {memory_.x, memory_.x0}) {
        SR_TRY(const std::vector<std::byte> bytes, slot.read<std::byte>(device_));
        saved.insert(saved.end(), bytes.begin(), bytes.end());
    }
    return saved;
}

Status Replay::resume(std::span<const std::byte> saved, uint64_t key)
{
    SR_ASSERT(active_, "a run is taken up that has not begun");
    SavedRun head;
    const SavedRun here{.key = key, .rows = rows_, .bytes = memory_.x.bytes()};
    if (saved.size() != sizeof(head) + 2 * here.bytes)
        return fail(ErrorCode::bad_input, "a saved run of {} bytes; this one has {}", saved.size(),
                    sizeof(head) + 2 * here.bytes);
    std::memcpy(&head, saved.data(), sizeof(head));
    if (std::memcmp(head.magic, here.magic, sizeof(head.magic)) != 0 || head.version != here.version)
        return fail(ErrorCode::bad_input, "these are not the bytes of a saved run");
    if (head.key != key || head.rows != rows_ || head.bytes != here.bytes || head.row > rows_)
        return fail(ErrorCode::bad_input, "the saved run is another one: other inputs, plan, seed or options");
    SR_CHECK(memory_.x.write(device_, saved.subspan(sizeof(head), here.bytes)));
    SR_CHECK(memory_.x0.write(device_, saved.subspan(sizeof(head) + here.bytes, here.bytes)));
    row_ = size_t(head.row);
    return set_clock(first_ + uint32_t(row_));
}

} // namespace semrover
