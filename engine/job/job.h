// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/base/result.h"

#include <cstdint>
#include <functional>
#include <string_view>

// Long work that its caller takes a piece of at a time: the program runs it to the end, a game gives it what a frame
// has left. Nothing here prints, reads options or looks at signals.
namespace semrover {

// What one step may spend. The step ends before the first of the two is exceeded, but always does some work.
struct JobBudget {
    uint32_t submits = ~0u; // steps of a network or the like that are handed to the device
    // of the caller's time and the device's together: where it is given, a step waits for what it submits, and stops
    // when one more submit would take too long, going by those before
    uint64_t microseconds = ~0ull;

    bool timed() const { return microseconds != ~0ull; }
    static JobBudget unlimited() { return {}; }
    static JobBudget one_submit() { return {1, ~0ull}; }
};

struct JobProgress {
    std::string_view stage; // "generate"
    std::string_view unit;  // of the counts: "cells"
    size_t done = 0, total = 0;
    size_t done_before = 0;    // of `done`: by an earlier start of the same run
    double part = 0;           // of the piece of work that is not counted yet, 0..1
    uint64_t device_bytes = 0; // 0: as said before
    bool ended = false;        // the stage is done: the last word about it
};

// Called on the thread that calls begin, step or finish, before that call returns. Any of them may be empty.
struct JobCallbacks {
    std::function<void(const JobProgress&)> progress;
    std::function<void(std::string_view message)> warning;
    std::function<void(std::string_view line)> detail; // figures on the way, for who wants to read more
};

// A job is made by a function `begin_...` of its own header, which refuses all that can be refused before any work, and
// plans memory. Threads: one at a time.
class Job {
  public:
    virtual ~Job() = default;

    // Does up to `budget` of what is left. true: all is done but finish(). After an error only cancel() and the
    // destructor may follow; what was finished before the error is kept where the job has a run folder.
    virtual Result<bool> step(const JobBudget& budget) = 0;

    // Writes what is written last, and returns figures of the run. Only after step() returned true.
    virtual Result<Json> finish() = 0;

    // Waits for what was submitted and gives up the rest. A job with a run folder can be begun again and goes on.
    virtual void cancel() = 0;

    // where what is done so far is kept for a job that is begun again; empty: nowhere
    virtual Path kept_in() const { return {}; }
};

} // namespace semrover
