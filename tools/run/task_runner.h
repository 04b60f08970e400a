// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"
#include "tools/cli/session.h"
#include "tools/run/attempt.h"
#include "tools/run/task.h"

namespace semrover {

// Does tasks of a job, one after the other, with one device and one copy of each model.
class TaskRunner {
  public:
    enum class Outcome : uint8_t { done, was_done, by_another };

    // wait: seconds for what another process makes to be seen here. The job outlives this
    TaskRunner(const JobFile& job, const Globals& globals, double wait);

    // Does a task and publishes it, unless it is published already. Errors: busy where a scene that it needs is not
    // there (yet); the command's
    Result<Outcome> run(const Task& task);
    // What generating a scene would take: the figures of `generate --dry-run`. Errors: as run()
    Result<Json> expect(const Task& scene);
    uint64_t peak_device_bytes() const { return globals_.session->results.value("peak_device_bytes", uint64_t(0)); }
    std::string device_name() const { return globals_.session->device ? globals_.session->device->name() : ""; }
    void drop_models() { globals_.session->drop_models(); } // of the tasks so far

  private:
    Result<bool> is_published(const Task& task, const std::string& key) const;
    Status wait_for_scene(const Task& task);
    Result<Outcome> attempt(const Task& task, const std::string& key);
    Status make(const Task& task, const Attempt& attempt) const;
    std::vector<std::string> scene_line(const Task& task, const Path& work) const;
    std::vector<std::string> drive_line(const Task& task, const Path& work) const;
    Status make_street(const JobScene& scene, const Path& folder) const;
    Status seal_shards(const Task& task, const Attempt& attempt, Manifest manifest) const;
    Status seal(const Task& task, const Attempt& attempt, Manifest manifest) const;

    const JobFile& job_;
    Globals globals_;
    TaskKeys keys_;
    double wait_;
};

// Why a task failed the last time: kept in the job's folder until it is done
struct TaskFailure {
    ErrorCode code = ErrorCode::internal;
    std::string message, host;
};
void keep_failure(const Path& out, const Task& task, const Error& error);
std::optional<TaskFailure> failure_of(const Path& out, const Task& task);
void forget_failure(const Path& out, const Task& task);

} // namespace semrover
