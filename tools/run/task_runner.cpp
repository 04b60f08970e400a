// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/task_runner.h"

#include "engine/voxfield/voxfield_model.h"
#include "runtime/base/final_name.h"
#include "runtime/base/hash.h"
#include "runtime/base/quote.h"
#include "runtime/system/host_name.h"
#include "runtime/system/system.h"
#include "tools/cli/interrupt.h"
#include "tools/cli/open_device.h"
#include "tools/cli/print_stderr.h"
#include "tools/cli/value_options.h"
#include "tools/dataset/pack_shards.h"
#include "tools/run/command_options.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fmt/chrono.h>
#include <thread>

namespace semrover {

namespace {

namespace fs = std::filesystem;

constexpr int kMostDevices = 3; // that are lost, before the error stands
// of a run, and no result
constexpr const char* kState[] = {"run.json", "journal.jsonl", "scene.sgrid.run", "latents", "encoded", "lock"};
// of a street that is made up, what is of use to who has the scene
constexpr const char* kStreetFiles[] = {"semantic.sgrid", "objects.json", "street.json", "drive.tum"};

// what another program is to know of the options that are not a command's own
void append_device(std::vector<std::string>& line, const Globals& globals)
{
    if (!globals.device.empty())
        line.insert(line.end(), {"--device", globals.device});
    if (!globals.require.empty())
        line.insert(line.end(), {"--require", globals.require});
    if (globals.max_vram)
        line.insert(line.end(), {"--max-vram", std::to_string(globals.max_vram) + "B"});
}

std::string utc_now()
{
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

Path run_state(const Task& task)
{
    return task.drive ? "run.json" : "scene.sgrid.run/run.json";
}

// names of pictures that are not there are left out
Status forget_missing_pictures(const Path& folder)
{
    const Path path = folder / "transforms.json";
    if (!is_file(path))
        return {};
    SR_TRY(Json json, read_json(path));
    if (!json.is_object() || !json.value("frames", Json()).is_array())
        return {};
    for (Json& frame : json["frames"])
        for (auto member = frame.begin(); member != frame.end();) {
            const bool names_file = member.key().ends_with("_path") && member->is_string();
            member = names_file && !is_file(folder / member->get<std::string>()) ? frame.erase(member) : ++member;
        }
    return write_file_atomically(path, json_text(json, 1) + "\n");
}

// kinds of pictures that the job does not ask for
Status drop_pictures(const Path& folder, const std::vector<std::string>& kept)
{
    if (kept.empty())
        return {};
    std::vector<Path> dropped;
    std::error_code error;
    for (fs::recursive_directory_iterator i(folder, error), end; i != end; i.increment(error)) {
        const std::string name = i->path().filename().string();
        if (i->is_directory(error) && std::ranges::count(kBufferKinds, name) && !std::ranges::count(kept, name))
            dropped.push_back(i->path());
    }
    for (const Path& path : dropped)
        if (!error)
            fs::remove_all(path, error);
    if (error)
        return fail(ErrorCode::bad_input, "cannot remove pictures of {}: {}", quote_path(folder), error.message());
    return forget_missing_pictures(folder);
}

Path failure_file(const Path& out, const Task& task)
{
    std::string name = task.name();
    std::ranges::replace(name, '/', '.');
    return out / ".work" / "failed" / (name + ".json");
}

} // namespace

TaskRunner::TaskRunner(const JobFile& job, const Globals& globals, double wait)
    : job_(job), globals_(globals), keys_(job), wait_(wait)
{
    globals_.session = std::make_shared<Session>();
    globals_.yes = false; // what an attempt has is its own
}

// bad_input: what is there is of another task
Result<bool> TaskRunner::is_published(const Task& task, const std::string& key) const
{
    const Path there = job_.out / task.name();
    if (!is_folder(there))
        return false;
    const auto manifest = read_manifest(there);
    if (manifest && manifest->key == key)
        return true;
    return fail(ErrorCode::bad_input, "{} {}; -y moves it aside", quote_path(there),
                manifest ? "was made with other settings or inputs" : "has no manifest of ours");
}

// what another machine has made may take a while to be seen on this one
Status TaskRunner::wait_for_scene(const Task& task)
{
    const Task scene{task.scene, nullptr};
    SR_TRY(const std::string key, keys_.key(scene));
    const auto begin = std::chrono::steady_clock::now();
    for (bool said = false;;) {
        SR_TRY(const bool there, is_published(scene, key));
        if (there)
            return {};
        if (interrupt_requested())
            return fail(ErrorCode::interrupted, "interrupted");
        if (std::chrono::steady_clock::now() - begin >= std::chrono::duration<double>(wait_))
            return fail(ErrorCode::busy, "{}: {} is not there (yet)", task.name(), scene.name());
        if (!std::exchange(said, true) && !globals_.quiet)
            print_stderr("semrover: waiting up to {} s for {}\n", wait_, scene.name());
        std::error_code ignored; // to list a folder makes a network's file system look again
        for (fs::directory_iterator i(job_.out / "scenes", ignored), end; i != end; i.increment(ignored)) {
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
}

Result<TaskRunner::Outcome> TaskRunner::run(const Task& task)
{
    SR_TRY(const std::string key, keys_.key(task));
    SR_TRY(const bool there, is_published(task, key));
    if (there)
        return Outcome::was_done;
    if (task.drive && task.scene->source != JobScene::Source::points)
        SR_CHECK(wait_for_scene(task));
    for (int lost = 1;; ++lost) {
        const auto outcome = attempt(task, key);
        if (outcome || outcome.error().code != ErrorCode::device_lost || lost == kMostDevices)
            return outcome;
        globals_.session->drop_models();
        globals_.session->device.reset();
        print_stderr("semrover: warning: {}; going on with a new device from what is done\n", outcome.error().message);
    }
}

Result<TaskRunner::Outcome> TaskRunner::attempt(const Task& task, const std::string& key)
{
    const auto begin = std::chrono::steady_clock::now();
    SR_TRY(const auto device, open_device(globals_));
    SR_TRY(Attempt attempt, Attempt::create(job_.out, key));
    if (!attempt.adopt_finished(key)) {
        Manifest manifest;
        manifest.task = task.name();
        manifest.key = key;
        manifest.attempt = attempt.name();
        manifest.host = host_name();
        manifest.device = device->name();
        manifest.driver = device->driver();
        manifest.begun = utc_now();
        manifest.adopted = attempt.adopt(run_state(task), device->name(), device->driver(), [&](const auto& line) {
            if (!globals_.quiet)
                print_stderr("semrover: {}\n", line);
        });
        SR_CHECK(make(task, attempt));
        manifest.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        SR_CHECK(seal(task, attempt, std::move(manifest)));
    }
    SR_TRY(const Attempt::Published published, attempt.publish(task.name(), key));
    return published == Attempt::Published::by_this ? Outcome::done : Outcome::by_another;
}

Status TaskRunner::make_street(const JobScene& scene, const Path& folder) const
{
    SR_TRY(const FileType before, examine(folder / kStreetFiles[0]));
    if (before == FileType::regular) // of an attempt before
        return {};
    const Path making = folder.parent_path() / "street.making";
    std::error_code error;
    fs::remove_all(making, error);
    std::vector<std::string> line{"streets", "-o", making.string(), "--quiet"};
    append_options(line, scene.streets);
    append_device(line, globals_);
    SR_CHECK(run_scenes_command(line));
    SR_CHECK(make_folder(folder));
    for (size_t i = std::size(kStreetFiles); i-- > 0;) // the labels last: they say that all is there
        SR_CHECK(rename_whole(making / kStreetFiles[i], folder / kStreetFiles[i]));
    fs::remove_all(making, error);
    return {};
}

std::vector<std::string> TaskRunner::scene_line(const Task& task, const Path& work) const
{
    const JobScene& scene = *task.scene;
    const bool made = scene.source == JobScene::Source::street;
    std::vector<std::string> line{"generate", (made ? work / "street" / "semantic.sgrid" : scene.file).string()};
    line.insert(line.end(), {"-m", job_.model.string(), "-o", (work / "scene.sgrid").string(), "--seed",
                             std::to_string(task_seed(job_, task))});
    if (!scene.objects.empty()) {
        line.insert(line.end(), {"--objects", scene.objects});
    } else if (made) {
        const auto model = VoxfieldModel::open(job_.model);
        if (model && !model->config.condition.empty())
            line.insert(line.end(), {"--objects", (work / "street" / "objects.json").string()});
    }
    append_options(line, job_.generate);
    return line;
}

std::vector<std::string> TaskRunner::drive_line(const Task& task, const Path& work) const
{
    std::vector<std::string> line{job_.refined ? "refine" : "render", scene_file(job_, *task.scene).string()};
    line.insert(line.end(), {"-o", work.string(), "--path", trajectory_of(job_, task).string()});
    if (job_.refined)
        line.insert(line.end(), {"-m", job_.model.string(), "--seed", std::to_string(task_seed(job_, task))});
    if (!task.drive->rig.empty())
        line.insert(line.end(), {"--rig", task.drive->rig.string()});
    append_options(line, task.drive->options);
    return line;
}

Result<Json> TaskRunner::expect(const Task& task)
{
    SR_TRY(const std::string key, keys_.key(task));
    SR_TRY(const Attempt attempt, Attempt::create(job_.out, key));
    if (task.scene->source == JobScene::Source::street)
        SR_CHECK(make_street(*task.scene, attempt.work() / "street"));
    std::vector<std::string> line = scene_line(task, attempt.work());
    line.push_back("--dry-run");
    const Status done = run_command(line, globals_);
    std::error_code ignored;
    fs::remove_all(attempt.work(), ignored);
    SR_CHECK(done);
    return globals_.session->results;
}

Status TaskRunner::make(const Task& task, const Attempt& attempt) const
{
    SR_CHECK(make_folder(attempt.work()));
    if (task.drive)
        return run_command(drive_line(task, attempt.work()), globals_);
    if (task.scene->source == JobScene::Source::street)
        SR_CHECK(make_street(*task.scene, attempt.work() / "street"));
    return run_command(scene_line(task, attempt.work()), globals_);
}

// a picture's name in an archive says where it is of
std::string key_prefix(const Task& task)
{
    std::string prefix = fmt::format("{}_{}_", task.scene->name, task.drive->name);
    std::ranges::replace(prefix, '.', '-');
    return is_key_prefix(prefix) ? prefix : "";
}

// beside the pictures, which stay as they are until this is published
Status TaskRunner::seal_shards(const Task& task, const Attempt& attempt, Manifest manifest) const
{
    ShardOptions options;
    options.key_prefix = key_prefix(task);
    options.replace = true;
    options.skip.assign(std::begin(kState), std::end(kState));
    if (!job_.shard_bytes.empty()) {
        SR_TRY(options.shard_bytes, parse_memory_size(job_.shard_bytes));
    }
    SR_CHECK(pack_shards(attempt.work(), attempt.files(), options).map([](const auto&) {}));
    SR_TRY(manifest.files, list_contents(attempt.files()));
    return write_manifest(attempt.files(), manifest);
}

// what is published, with a manifest; as long as it has none, the run's state stays
Status TaskRunner::seal(const Task& task, const Attempt& attempt, Manifest manifest) const
{
    if (task.drive)
        SR_CHECK(drop_pictures(attempt.work(), job_.buffers));
    if (task.drive && job_.layout == JobLayout::shards)
        return seal_shards(task, attempt, std::move(manifest));
    SR_TRY(manifest.files, list_contents(attempt.work(), kState));
    SR_CHECK(write_manifest(attempt.work(), manifest));
    std::error_code error;
    fs::remove(attempt.work() / run_state(task), error); // first: nobody goes on from a run that has lost a part
    for (const char* name : kState)
        fs::remove_all(attempt.work() / name, error);
    if (const int failed = system::rename_surely(attempt.work(), attempt.files()))
        return fail(ErrorCode::bad_input, "cannot rename {}: {}", quote_path(attempt.work()),
                    system::message_of(failed));
    return {};
}

void keep_failure(const Path& out, const Task& task, const Error& error)
{
    const Path file = failure_file(out, task);
    if (!make_folder(file.parent_path()))
        return;
    const Json json{{"task", task.name()},
                    {"code", int(error.code)},
                    {"message", error.message},
                    {"host", host_name()},
                    {"time", utc_now()}};
    (void)write_file_atomically(file, json_text(json, 1) + "\n"); // the exit code says it, too
}

std::optional<TaskFailure> failure_of(const Path& out, const Task& task)
{
    const auto json = read_json(failure_file(out, task));
    if (!json || !json->is_object() || !json->value("code", Json()).is_number_integer() ||
        !json->value("message", Json()).is_string() || !json->value("host", Json()).is_string())
        return std::nullopt;
    return TaskFailure{ErrorCode(json->value("code", 70)), json->value("message", ""), json->value("host", "")};
}

void forget_failure(const Path& out, const Task& task)
{
    std::error_code ignored;
    fs::remove(failure_file(out, task), ignored);
}

} // namespace semrover
