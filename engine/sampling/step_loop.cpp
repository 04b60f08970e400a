// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/sampling/step_loop.h"

#include <cstddef>

namespace semrover {

namespace {

constexpr size_t kInFlight = 3; // submits ahead of the device

} // namespace

// a CPU gains nothing from rows ahead, and a run that is stopped would wait for them
size_t StepLoop::ahead() const
{
    return device_.limits().type == DeviceType::cpu || device_.profile() ? 0 : kInFlight;
}

Status StepLoop::begin(const StepMemory& memory)
{
    SR_CHECK(cancel());
    SR_CHECK(memory.x.clear(device_));
    SR_CHECK(memory.x0.clear(device_));
    const uint32_t row = 0;
    const BufferSlice word = memory.clock.slice().part(offsetof(StepClock, row), sizeof(row));
    SR_CHECK(device_.write(word, std::as_bytes(std::span(&row, 1))));
    row_ = 0;
    active_ = true;
    return {};
}

Result<bool> StepLoop::step(size_t submits)
{
    SR_ASSERT(active_, "a step of a run that has not begun, or has ended");
    for (; submits > 0 && row_ < rows_; --submits) {
        SR_TRY(Executable * executable, row_executable_(row_));
        SR_TRY(const uint64_t ticket, executable->submit());
        ++row_;
        flight_.push_back(ticket);
        if (flight_.size() > ahead()) {
            SR_CHECK(device_.wait(flight_.front()));
            flight_.pop_front();
            SR_CHECK(executable->collect_profile());
        }
    }
    if (row_ < rows_)
        return false;
    if (!flight_.empty())
        SR_CHECK(device_.wait(flight_.back()));
    flight_.clear();
    return true;
}

void StepLoop::end()
{
    SR_ASSERT(active_ && row_ == rows_, "a run is finished after {} of {} rows", row_, rows_);
    active_ = false;
}

Status StepLoop::cancel()
{
    active_ = false;
    const uint64_t last = flight_.empty() ? 0 : flight_.back();
    flight_.clear();
    return device_.wait(last);
}

} // namespace semrover
