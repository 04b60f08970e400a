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

// The work of a command whose run folder keeps what is done. Where its device is lost, it runs again and goes on with a
// new one: at most three devices, then the error stands.
Run resuming(const Globals& globals, Run work);

} // namespace semrover
