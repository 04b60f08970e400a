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

std::string words_when_interrupted(const Path& folder)
{
    if (folder.empty())
        return "interrupted";
    return fmt::format("interrupted; what is done is in {}, the same command goes on", quote_path(folder));
}

} // namespace

void keep_in(const Path& folder)
{
    set_interrupt_message(words_when_interrupted(folder));
}

tl::unexpected<Error> stopped(const Error& error, const Path& folder)
{
    if (error.code != ErrorCode::interrupted)
        return tl::make_unexpected(error);
    return fail(ErrorCode::interrupted, "{}", words_when_interrupted(folder));
}

Result<Json> run_job(const Globals& globals, const BeginJob& begin)
{
    JobDisplay display(globals);
    SR_TRY(const auto job, begin(display.callbacks()));
    keep_in(job->kept_in());
    const Status ended = step_to_end(*job, job->kept_in());
    if (!ended && ended.error().code == ErrorCode::interrupted)
        job->cancel();
    SR_CHECK(ended);
    return job->finish();
}

Run resuming(std::function<Status()> work)
{
    Run run(std::move(work));
    run.resumes = true;
    return run;
}

} // namespace semrover
