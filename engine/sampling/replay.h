// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/program.h"
#include "runtime/device/state.h"
#include "shaders/lib/step_row.h"

#include <deque>
#include <functional>

namespace semrover {

// what of a run lies on the device from row to row
struct ReplayMemory {
    Slot clock; // StepClock
    Slot x, x0; // the state, and the prediction of the row before

    static Slot clock_slot(State& state) { return state.slot(1, sizeof(StepClock) / 4, DType::u32, "clock", 2); }
};

// The step loop of everything that is sampled: rows of a step table, one submit each, a few of them ahead of the
// device. It may be stopped after any row; the next call goes on.
class Replay {
  public:
    // makes ready for a row - its timestep, noise that is given - and says which program runs it, which must end with
    // step_advance
    using Row = std::function<Result<Program*>(size_t row)>;

    Replay(Device& device, const ReplayMemory& memory, size_t rows, Row row)
        : device_(device), memory_(memory), rows_(rows), row_program_(std::move(row))
    {
    }

    // x and x0 become zero. Row 0 of the run is row `first` of the table: those before it are the caller's to run.
    Status begin(uint32_t first = 0);
    // submits at most that many rows; true when all are done and the device has finished them
    Result<bool> step(size_t submits);
    // ends the run where it is, after waiting for what was submitted
    Status cancel();

    bool active() const { return active_; } // begun, and neither cancelled nor ended
    size_t row() const { return row_; }     // the next one to submit
    size_t rows() const { return rows_; }
    void end() { active_ = false; }

  private:
    size_t ahead() const;
    Status set_clock(uint32_t row);

    Device& device_;
    ReplayMemory memory_;
    size_t rows_, row_ = 0;
    uint32_t first_ = 0;
    bool active_ = false;
    Row row_program_;
    std::deque<uint64_t> flight_; // tickets of rows that the device may still work on
};

} // namespace semrover
