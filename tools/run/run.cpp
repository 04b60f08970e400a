// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover run JOB: many scenes and drives of one file, here or a part of them on each of many machines
#include "runtime/base/bytes_text.h"
#include "runtime/base/quote.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/progress.h"
#include "tools/cli/run_job.h"
#include "tools/cli/value_options.h"
#include "tools/run/estimate.h"
#include "tools/run/task_runner.h"

#include <algorithm>
#include <chrono>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr uint32_t kMostParts = 1000; // an array of Slurm's has at most 1001 elements
constexpr double kDay = 86400;

struct RunArguments {
    Path job, output;
    std::string part, stage;
    std::optional<double> wait;
    uint32_t most = kMostParts;
    bool dry_run = false, list = false, parts = false, status = false, check = false, clean = false, strict = false;
};

// "2/7": the parts are 0 to 6
Result<TaskChoice> choice_of(const RunArguments& o)
{
    TaskChoice choice;
    choice.scenes = o.stage != "drive";
    choice.drives = o.stage != "scene";
    if (o.part.empty())
        return choice;
    const size_t slash = o.part.find('/');
    const auto part = parse_number<uint32_t>(o.part.substr(0, slash), {0, ~0u});
    const auto parts = parse_number<uint32_t>(slash == std::string::npos ? "" : o.part.substr(slash + 1), {1, ~0u});
    if (!part || !parts || *part >= *parts)
        return fail(ErrorCode::usage, "--part takes I/N with I from 0 to N - 1, found {}", quote(o.part));
    choice.part = *part;
    choice.parts = *parts;
    return choice;
}

size_t scenes_with_work(const JobFile& job)
{
    std::set<const JobScene*> scenes;
    for (const Task& task : tasks_of(job, {}))
        scenes.insert(task.scene);
    return scenes.size();
}

Json task_json(const JobFile& job, const Task& task)
{
    Json inputs = Json::array(), needs = Json::array();
    if (!task.scene->file.empty())
        inputs.push_back(task.scene->file.string());
    if (!job.model.empty() && (!task.drive || job.refined))
        inputs.push_back(job.model.string());
    if (task.drive) {
        if (!task.drive->made)
            inputs.push_back(trajectory_of(job, task).string());
        if (!task.drive->rig.empty())
            inputs.push_back(task.drive->rig.string());
        if (task.scene->source != JobScene::Source::points)
            needs.push_back(Task{task.scene, nullptr}.name());
    }
    return {{"task", task.name()}, {"inputs", inputs}, {"needs", needs}, {"output", (job.out / task.name()).string()}};
}

Status list_tasks(const JobFile& job, const std::vector<Task>& tasks, const Globals& globals)
{
    for (const Task& task : tasks)
        if (globals.json)
            fmt::print("{}\n", json_text(task_json(job, task)));
        else
            fmt::print("{}\n", task.name());
    return {};
}

// how far a task is, from what lies in the job's folder
struct TaskState {
    std::string state; // done, other, failed, begun, missing
    std::string detail = {};
};

TaskState state_of(const JobFile& job, const Task& task, const std::string& key, const std::set<std::string>& begun)
{
    if (const auto manifest = read_manifest(job.out / task.name()))
        return manifest->key == key ? TaskState{"done", manifest->host + ", " + manifest->device}
                                    : TaskState{"other", "made with other settings or inputs"};
    if (const auto failure = failure_of(job.out, task))
        return {"failed", fmt::format("code {} on {}: {}", int(failure->code), failure->host, failure->message)};
    return {begun.contains(key) ? "begun" : "missing"};
}

Status show_status(const JobFile& job, const std::vector<Task>& tasks, const Globals& globals)
{
    TaskKeys keys(job);
    const std::set<std::string> begun = Attempt::keys(job.out);
    std::map<std::string, size_t> counts;
    for (const Task& task : tasks) {
        SR_TRY(const std::string key, keys.key(task));
        const TaskState state = state_of(job, task, key, begun);
        ++counts[state.state];
        if (globals.json)
            fmt::print("{}\n",
                       json_text(Json{{"task", task.name()}, {"state", state.state}, {"detail", state.detail}}));
        else if (state.state != "done" || globals.verbose)
            fmt::print("{}: {}{}{}\n", task.name(), state.state, state.detail.empty() ? "" : ", ", state.detail);
    }
    if (!globals.json)
        fmt::print("{} tasks: {} done, {} failed, {} begun, {} missing, {} of other settings\n", tasks.size(),
                   counts["done"], counts["failed"], counts["begun"], counts["missing"], counts["other"]);
    return {};
}

// every byte of what is published, and whether one kind of device made it
Status check_published(const JobFile& job, const std::vector<Task>& tasks, bool strict)
{
    TaskKeys keys(job);
    std::map<std::string, size_t> devices;
    size_t wrong = 0, missing = 0;
    for (const Task& task : tasks) {
        SR_TRY(const std::string key, keys.key(task));
        const auto manifest = read_manifest(job.out / task.name());
        if (!manifest || manifest->key != key) {
            ++missing;
            fmt::print("{}: {}\n", task.name(), manifest ? "made with other settings or inputs" : "not published");
            continue;
        }
        ++devices[manifest->device + ", " + manifest->driver];
        const std::vector<std::string> lines = differences(job.out / task.name(), *manifest);
        wrong += !lines.empty();
        for (const std::string& line : lines)
            fmt::print("{}: {}\n", task.name(), line);
    }
    for (const auto& [device, count] : devices)
        fmt::print("{} tasks by {}\n", count, device);
    fmt::print("{} of {} tasks are as they were published\n", tasks.size() - wrong - missing, tasks.size());
    const bool mixed = devices.size() > 1;
    if (wrong || missing || (strict && mixed))
        return fail(ErrorCode::verify_failed, "{}",
                    wrong || missing ? "not all of the job is as it was published"
                                     : "the job is of several devices or drivers");
    return {};
}

Status clean(const JobFile& job, const Globals& globals)
{
    TaskKeys keys(job);
    std::set<std::string> done;
    for (const Task& task : tasks_of(job, {})) {
        SR_TRY(const std::string key, keys.key(task));
        const auto manifest = read_manifest(job.out / task.name());
        if (manifest && manifest->key == key)
            done.insert(key);
    }
    const size_t removed = Attempt::clean(job.out, kDay, [&](const std::string& key) { return done.contains(key); });
    if (!globals.quiet)
        fmt::print("{} attempts removed\n", removed);
    return {};
}

// what is there of other settings makes room
Status move_aside(const JobFile& job, const std::vector<Task>& tasks)
{
    TaskKeys keys(job);
    for (const Task& task : tasks) {
        const Path there = job.out / task.name();
        const auto manifest = read_manifest(there);
        SR_TRY(const std::string key, keys.key(task));
        if (!is_there(there) || (manifest && manifest->key == key))
            continue;
        Path aside = job.out / ".work" / "aside" / task.name();
        aside += fmt::format(".{}", std::chrono::system_clock::now().time_since_epoch().count());
        SR_CHECK(make_folder(aside.parent_path()));
        std::error_code error;
        fs::rename(there, aside, error);
        if (error)
            return fail(ErrorCode::bad_input, "cannot move {} aside: {}", quote_path(there), error.message());
    }
    return {};
}

Status dry_run(const JobFile& job, std::vector<Task> tasks, const Globals& globals)
{
    TaskKeys keys(job);
    size_t done = 0;
    for (auto task = tasks.begin(); task != tasks.end();) {
        SR_TRY(const std::string key, keys.key(*task));
        const auto manifest = read_manifest(job.out / task->name());
        const bool there = manifest && manifest->key == key;
        done += there;
        task = there ? tasks.erase(task) : task + 1;
    }
    SR_TRY(Json e, estimate(job, tasks, globals));
    e["done"] = done;
    if (globals.json) {
        fmt::print("{}\n", json_text(e));
        return {};
    }
    fmt::print("{} scenes to generate, {} drives of {} frames to draw{}; {} tasks are done\n",
               e["scenes"].get<size_t>(), e["drives"].get<size_t>(), e["frames"].get<size_t>(),
               job.refined ? " and refine" : "", done);
    if (!tasks.empty())
        fmt::print("about {} on {}, of which scenes {}\nabout {} in {} files; device memory {} at most\n",
                   duration_text(e["seconds"]), e["device"].get<std::string>(), duration_text(e["scene_seconds"]),
                   bytes_text(e["bytes"]), e["files"].get<uint64_t>(), bytes_text(e["device_bytes"]));
    return {};
}

struct Tally {
    size_t done = 0, were_done = 0, by_others = 0, failed = 0, waiting = 0;
};

bool ends_the_part(ErrorCode code)
{
    return code == ErrorCode::interrupted || code == ErrorCode::no_device || code == ErrorCode::device_lost;
}

void say(const Globals& globals, const Task& task, size_t number, size_t count, std::string_view what)
{
    if (globals.log_json)
        print_stderr("{}\n",
                     json_text(Json{{"task", task.name()}, {"number", number}, {"of", count}, {"state", what}}));
    else if (!globals.quiet)
        print_stderr("semrover: {}/{} {}: {}\n", number, count, task.name(), what);
}

// Tasks that fail do not keep the others from being done
Result<Tally> run_tasks(const JobFile& job, const std::vector<Task>& tasks, const Globals& globals, double wait)
{
    TaskRunner runner(job, globals, wait);
    Tally tally;
    bool scenes = true;
    for (size_t i = 0; i < tasks.size(); ++i) {
        const Task& task = tasks[i];
        if (std::exchange(scenes, !task.drive) && task.drive)
            runner.drop_models(); // of another stage from here on
        say(globals, task, i + 1, tasks.size(), "begins");
        const auto outcome = runner.run(task);
        if (!outcome && ends_the_part(outcome.error().code))
            return tl::make_unexpected(outcome.error());
        if (!outcome) {
            const bool busy = outcome.error().code == ErrorCode::busy;
            ++(busy ? tally.waiting : tally.failed);
            if (!busy)
                keep_failure(job.out, task, outcome.error());
            print_stderr("semrover: {}: {}: {}\n", busy ? "warning" : "error", task.name(), outcome.error().message);
            continue;
        }
        forget_failure(job.out, task);
        using Outcome = TaskRunner::Outcome;
        ++(*outcome == Outcome::done         ? tally.done
           : *outcome == Outcome::by_another ? tally.by_others
                                             : tally.were_done);
        say(globals, task, i + 1, tasks.size(),
            *outcome == Outcome::done         ? "done"
            : *outcome == Outcome::by_another ? "done by another at the same time"
                                              : "was done");
    }
    return tally;
}

Status run_all(const JobFile& job, const std::vector<Task>& tasks, const RunArguments& o, const Globals& globals)
{
    if (globals.yes)
        SR_CHECK(move_aside(job, tasks));
    SR_CHECK(make_folder(job.out));
    keep_in(job.out);
    const auto tally = run_tasks(job, tasks, globals, o.wait.value_or(o.stage == "drive" ? 120 : 0));
    if (!tally)
        return stopped(tally.error(), job.out);
    const Json results{{"tasks", tasks.size()},         {"done", tally->done},     {"were_done", tally->were_done},
                       {"by_others", tally->by_others}, {"failed", tally->failed}, {"waiting", tally->waiting},
                       {"output", job.out.string()}};
    if (globals.json)
        fmt::print("{}\n", json_text(results));
    else if (!globals.quiet)
        fmt::print("{} tasks: {} done, {} were done, {} failed, {} wait for others; {}\n", tasks.size(),
                   tally->done + tally->by_others, tally->were_done, tally->failed, tally->waiting,
                   quote_path(job.out));
    if (tally->failed)
        return fail(ErrorCode::partial, "{} of {} tasks failed (semrover run --status says why)", tally->failed,
                    tasks.size());
    if (tally->waiting)
        return fail(ErrorCode::busy, "{} of {} tasks wait for what is not there yet", tally->waiting, tasks.size());
    return {};
}

Status run(const RunArguments& o, const Globals& globals)
{
    SR_TRY(const TaskChoice choice, choice_of(o));
    SR_TRY(const JobFile job, read_job_file(o.job, o.output));
    if (o.parts) {
        fmt::print("{}\n", std::max<size_t>(1, std::min<size_t>(o.most, scenes_with_work(job))));
        return {};
    }
    const std::vector<Task> tasks = tasks_of(job, choice);
    if (o.dry_run)
        return dry_run(job, tasks, globals);
    if (o.list)
        return list_tasks(job, tasks, globals);
    if (o.status)
        return show_status(job, tasks, globals);
    if (o.check)
        return check_published(job, tasks, o.strict);
    if (o.clean)
        return clean(job, globals);
    return run_all(job, tasks, o, globals);
}

} // namespace

void add_run(CLI::App& app, const Globals& globals, Run& command)
{
    const auto o = std::make_shared<RunArguments>();
    CLI::App* c = app.add_subcommand("run", "many scenes and drives that a job file names, here or in parts");
    c->add_option("JOB", o->job, "job file, .toml or .json")->required();
    c->add_option("-o,--output", o->output, "folder, in place of the job's own 'out'");
    c->add_option("--part", o->part,
                  "I/N: only part I of N, from 0 on; parts can run at the same time, on other machines too");
    add_choice(*c, "--stage", {"scene", "drive"}, "only the scenes, or only the drives through them", o->stage);
    add_number(*c, "--wait", o->wait,
               "seconds for a scene that another process makes to be seen; 120 with --stage drive", 0, 86400);
    CLI::Option* dry = c->add_flag("--dry-run", o->dry_run,
                                   "only say what is left to do, about how long it takes, how much memory and disk");
    CLI::Option* list = c->add_flag("--list", o->list, "only list the tasks; with --json a line each");
    CLI::Option* parts = c->add_flag("--parts", o->parts, "only say in how many parts the job can be cut");
    add_number(*c, "--most", o->most, "--parts: at most", 1u, kMostParts)->needs(parts);
    CLI::Option* status = c->add_flag("--status", o->status, "only say what is done, failed, begun, missing");
    CLI::Option* check = c->add_flag("--check", o->check, "only read all that is published again");
    c->add_flag("--same-device", o->strict, "--check: refuse what several kinds of devices have made")->needs(check);
    CLI::Option* clean =
        c->add_flag("--clean", o->clean, "only remove attempts that were given up a day ago, at tasks that are done");
    CLI::Option* const only[] = {dry, list, parts, status, check, clean};
    for (CLI::Option* a : only)
        for (CLI::Option* b : only)
            if (a != b)
                a->excludes(b);
    c->callback([o, &globals, &command] { command = resuming([o, &globals] { return run(*o, globals); }); });
}

} // namespace semrover
