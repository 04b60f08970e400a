// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/job.h"
#include "tools/cli/commands.h"

#include <functional>
#include <memory>

namespace semrover {

using BeginJob = std::function<Result<std::unique_ptr<Job>>(const JobCallbacks&)>;

// what a job says, on stderr as the globals ask: warnings, progress, and details with --verbose
class JobDisplay {
  public:
    explicit JobDisplay(const Globals& globals);
    JobCallbacks callbacks(); // the display outlives the job

  private:
    void show(const JobProgress& p);

    const Globals& globals_;
    std::unique_ptr<class Progress> progress_; // of the stage at work

  public:
    ~JobDisplay();
};

// Begins a job and steps it to its end; returns what its finish() does. Ctrl-C cancels it: interrupted, and the message
// says where what is done is kept.
Result<Json> run_job(const Globals& globals, const BeginJob& begin);

// For work that a command steps itself, and keeps in a folder (empty: nowhere): what Ctrl-C says from now on
void keep_in(const Path& folder);
// The error that a step ended with. Where the user stopped it, or the device that asks the same, it says where what is
// done is kept
tl::unexpected<Error> stopped(const Error& error, const Path& folder);

// Steps a job or a world to its end. Errors as stopped() says them
template <typename Work>
Status step_to_end(Work& work, const Path& folder)
{
    for (bool done = false; !done;) {
        const Result<bool> step =
            interrupt_requested() ? fail(ErrorCode::interrupted, "") : work.step(JobBudget::one_submit());
        if (!step)
            return stopped(step.error(), folder);
        done = *step;
    }
    return {};
}

} // namespace semrover
