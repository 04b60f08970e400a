// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/executable.h"
#include "runtime/device/tensor_pool.h"
#include "shaders/lib/step_row.h"

#include <deque>
#include <functional>

namespace semrover {

// what of a run lies on the device from row to row
struct StepMemory {
    DeviceTensor clock; // StepClock
    DeviceTensor x, x0; // the state, and the prediction of the row before

    static DeviceTensor clock_tensor(TensorPool& state)
    {
        return state.tensor(1, sizeof(StepClock) / 4, DType::u32, "clock", 2);
    }
};

// The step loop of everything that is sampled: rows of a step table, one submit each, a few of them ahead of the
// device. It may be stopped after any row; the next call goes on.
class StepLoop {
  public:
    // makes ready for a row - its timestep, noise that is given - and says which executable runs it, which must end
    // with step_advance
    using Row = std::function<Result<Executable*>(size_t row)>;

    StepLoop(Device& device, size_t rows, Row row) : device_(device), rows_(rows), row_executable_(std::move(row)) {}

    // x, x0 and the clock become zero; rows of the table before the run's are the caller's to run
    Status begin(const StepMemory& memory);
    // submits at most that many rows; true when all are done and the device has finished them
    Result<bool> step(size_t submits);
    // ends the run where it is, after waiting for what was submitted
    Status cancel();
    // ends it after its last row
    void end();

    size_t rows_done() const { return row_; }
    size_t rows() const { return rows_; }

  protected:
    Device& device_;

  private:
    size_t ahead() const;

    size_t rows_, row_ = 0;
    bool active_ = false; // begun, and neither cancelled nor ended
    Row row_executable_;
    std::deque<uint64_t> flight_; // tickets of rows that the device may still work on
};

} // namespace semrover
