// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/estimate.h"

#include "engine/format/transforms.h"
#include "runtime/system/host_name.h"
#include "runtime/system/system.h"
#include "tools/commands/trajectory_options.h"
#include "tools/run/command_options.h"
#include "tools/run/task_runner.h"

#include <algorithm>
#include <CLI/CLI.hpp>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// of how splats are drawn, not of where cameras are
constexpr std::string_view kOfDrawing[] = {"--allow-empty",   "--splat-radius", "--opacity",
                                           "--visible-alpha", "--background",   "--screen-filter"};

// the cameras of a drive, and those of its options that are not about them
struct Cameras {
    CameraPath path;
    std::vector<JobOption> others;
};

Result<Cameras> cameras_of(const JobFile& job, const Task& task)
{
    Cameras cameras;
    CLI::App app;
    TrajectoryOptions options;
    add_trajectory_options(app, options);
    std::vector<std::string> line;
    for (const auto& [name, value] : task.drive->options) {
        if (std::ranges::count(kOfDrawing, name) || !app.get_option_no_throw(name)) {
            cameras.others.emplace_back(name, value);
            continue;
        }
        line.push_back(name);
        if (!value.empty())
            line.push_back(value);
    }
    line.insert(line.end(), {"--path", trajectory_of(job, task).string()});
    if (!task.drive->rig.empty())
        line.insert(line.end(), {"--rig", task.drive->rig.string()});
    std::ranges::reverse(line);
    app.parse(line); // as read_job_file() has done
    SR_TRY(cameras.path, load_cameras(options));
    SR_CHECK(need_cameras(cameras.path, "an estimate"));
    return cameras;
}

// the first two moments
CameraPath beginning_of(const CameraPath& path)
{
    CameraPath first{{}, path.sensors};
    std::vector<double> times;
    for (const CameraFrame& frame : path.frames) {
        if (!std::ranges::count(times, frame.time))
            times.push_back(frame.time);
        if (times.size() > 2)
            break;
        first.frames.push_back(frame);
    }
    return first;
}

struct Rate {
    double seconds = 0, bytes = 0, files = 0;
};

Rate rate_of(const Path& published)
{
    Rate rate;
    if (const auto manifest = read_manifest(published)) {
        rate.seconds = manifest->seconds;
        rate.files = double(manifest->files.size());
        for (const Manifest::File& file : manifest->files)
            rate.bytes += double(file.bytes);
    }
    return rate;
}

class Trial {
  public:
    Trial(const JobFile& job, const std::vector<Task>& tasks, const Globals& globals)
        : job_(job), tasks_(tasks), globals_(globals)
    {
        trial_ = job;
        trial_.out = job.out / ".work" / fmt::format("trial-{}-{}", host_name(), system::process_number());
    }
    ~Trial()
    {
        std::error_code ignored;
        fs::remove_all(trial_.out, ignored);
        for (const Path& folder : {job_.out / ".work", job_.out})
            fs::remove(folder, ignored); // stays if it holds anything
    }
    Result<Json> run();

  private:
    const Task& smallest() const
    {
        return *std::ranges::min_element(tasks_, {}, [](const Task& t) { return t.scene->weight; });
    }
    Status try_scene(TaskRunner& runner, const JobScene& scene);
    Status try_drive(const Task& task);
    Result<size_t> frames_of(const Task& task);

    const JobFile& job_;
    const std::vector<Task>& tasks_;
    const Globals& globals_;
    JobFile trial_;
    Rate scene_;                         // of a unit of weight
    std::map<std::string, Rate> drives_; // of a frame, by the drive's name
    std::map<Path, size_t> frames_;      // by trajectory
    std::map<std::string, size_t> made_; // frames of the trial's street, by drive
    uint64_t device_bytes_ = 0;
    std::string device_;
};

// One step shows what is written; how long all steps take is measured by the command
Status Trial::try_scene(TaskRunner& runner, const JobScene& scene)
{
    const Task task{&scene, nullptr};
    SR_TRY(const Json expected, runner.expect(task));
    device_bytes_ = std::max(device_bytes_, expected.value("peak_device_bytes", uint64_t(0)));
    std::erase_if(trial_.generate, [](const JobOption& o) { return o.first == "--steps" || o.first == "--preset"; });
    trial_.generate.emplace_back("--steps", "1");
    SR_CHECK(runner.run(task).map([](auto) {}));
    scene_ = rate_of(trial_.out / task.name());
    scene_.seconds = expected.value("seconds", 0.0);
    for (double* part : {&scene_.seconds, &scene_.bytes})
        *part /= double(std::max<uint64_t>(scene.weight, 1));
    return {};
}

Status Trial::try_drive(const Task& task)
{
    SR_TRY(Cameras cameras, cameras_of(trial_, task));
    made_[task.drive->name] = cameras.path.frames.size();
    const CameraPath first = beginning_of(cameras.path);
    const Path file = trial_.out / "first.json";
    SR_CHECK(make_folder(trial_.out));
    SR_CHECK(write_transforms(file, first));
    JobDrive drive = *task.drive;
    drive.made = false;
    drive.path = file.string();
    drive.rig.clear();
    drive.options = cameras.others;
    if (!std::ranges::count(drive.options, JobOption("--allow-empty", "")))
        drive.options.emplace_back("--allow-empty", "");
    const Task trial{task.scene, &drive};
    TaskRunner runner(trial_, globals_, 0);
    SR_CHECK(runner.run(trial).map([](auto) {}));
    Rate rate = rate_of(trial_.out / trial.name());
    for (double* part : {&rate.seconds, &rate.bytes, &rate.files})
        *part /= double(first.frames.size());
    drives_[drive.name] = rate;
    device_bytes_ = std::max(device_bytes_, runner.peak_device_bytes());
    return {};
}

Result<size_t> Trial::frames_of(const Task& task)
{
    if (task.drive->made)
        return made_[task.drive->name];
    const Path path = trajectory_of(job_, task);
    const auto known = frames_.find(path / task.drive->name);
    if (known != frames_.end())
        return known->second;
    SR_TRY(const Cameras cameras, cameras_of(job_, task));
    return frames_[path / task.drive->name] = cameras.path.frames.size();
}

Result<Json> Trial::run()
{
    const JobScene& scene = *smallest().scene;
    std::set<std::string> tried;
    {
        TaskRunner runner(trial_, globals_, 0);
        if (scene.source != JobScene::Source::points)
            SR_CHECK(try_scene(runner, scene));
        device_ = runner.device_name();
    }
    for (const Task& task : tasks_)
        if (task.drive && tried.insert(task.drive->name).second)
            SR_CHECK(try_drive({&scene, task.drive}));
    size_t scenes = 0, drives = 0, frames = 0;
    Rate of_scenes, of_drives;
    for (const Task& task : tasks_) {
        const double weight = double(std::max<uint64_t>(task.scene->weight, 1));
        if (!task.drive) {
            ++scenes;
            of_scenes.seconds += scene_.seconds * weight;
            of_scenes.bytes += scene_.bytes * weight;
            of_scenes.files += scene_.files;
            continue;
        }
        ++drives;
        SR_TRY(const size_t count, frames_of(task));
        const Rate& rate = drives_[task.drive->name];
        frames += count;
        of_drives.seconds += rate.seconds * double(count);
        of_drives.bytes += rate.bytes * double(count);
        of_drives.files += rate.files * double(count);
    }
    return Json{{"scenes", scenes},
                {"drives", drives},
                {"frames", frames},
                {"scene_seconds", of_scenes.seconds},
                {"drive_seconds", of_drives.seconds},
                {"seconds", of_scenes.seconds + of_drives.seconds},
                {"bytes", uint64_t(of_scenes.bytes + of_drives.bytes)},
                {"files", uint64_t(of_scenes.files + of_drives.files)},
                {"device_bytes", device_bytes_},
                {"device", device_}};
}

} // namespace

Result<Json> estimate(const JobFile& job, const std::vector<Task>& tasks, const Globals& globals)
{
    if (tasks.empty())
        return Json{{"scenes", 0}, {"drives", 0}, {"frames", 0}, {"seconds", 0}};
    return Trial(job, tasks, globals).run();
}

} // namespace semrover
