// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/cli/run_job.h"

#include "runtime/base/quote.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"

namespace semrover {

JobDisplay::JobDisplay(const Globals& globals) : globals_(globals) {}
JobDisplay::~JobDisplay() = default;

JobCallbacks JobDisplay::callbacks()
{
    JobCallbacks c;
    c.progress = [this](const JobProgress& p) { show(p); };
    if (!globals_.quiet)
        c.warning = [](std::string_view message) { print_stderr("semrover: warning: {}\n", message); };
    if (globals_.verbose && !globals_.quiet)
        c.detail = [](std::string_view line) { print_stderr("{}\n", line); };
    return c;
}

// the first word about a stage starts its clock and shows nothing
void JobDisplay::show(const JobProgress& p)
{
    const bool first = !progress_;
    if (first)
        progress_ = std::make_unique<Progress>(progress_to_stderr(globals_), std::string(p.stage), std::string(p.unit),
                                               p.total, p.done_before);
    if (!first || p.ended)
        progress_->update(p.done, p.device_bytes ? std::optional(p.device_bytes) : std::nullopt);
    if (!p.ended)
        return;
    progress_->finish();
    progress_.reset();
}

namespace {

std::string words_when_interrupted(const Job& job)
{
    if (job.kept_in().empty())
        return "interrupted";
    return fmt::format("interrupted; what is done is in {}, the same command goes on", quote_path(job.kept_in()));
}

} // namespace

Result<Json> run_job(const Globals& globals, const BeginJob& begin)
{
    JobDisplay display(globals);
    SR_TRY(const auto job, begin(display.callbacks()));
    set_interrupt_message(words_when_interrupted(*job));
    for (bool done = false; !done;) {
        Result<bool> step =
            interrupt_requested() ? fail(ErrorCode::interrupted, "") : job->step(JobBudget::one_submit());
        if (!step && step.error().code == ErrorCode::interrupted) { // by us, or by the device, which asks the same
            job->cancel();
            return fail(ErrorCode::interrupted, "{}", words_when_interrupted(*job));
        }
        SR_TRY(done, std::move(step));
    }
    return job->finish();
}

Run resuming(const Globals& globals, Run work)
{
    return [&globals, work = std::move(work)]() -> Status {
        constexpr int kMostDevices = 3;
        for (int devices = 1;; ++devices) {
            Status status = work();
            if (status || status.error().code != ErrorCode::device_lost || devices == kMostDevices)
                return status;
            if (!globals.quiet)
                print_stderr("semrover: warning: {}; going on with a new device from what is done\n",
                             status.error().message);
        }
    };
}

} // namespace semrover
