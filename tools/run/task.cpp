// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/run/task.h"

#include "engine/job/version.h"
#include "runtime/base/hash.h"
#include "tools/run/wildcard.h"

#include <algorithm>
#include <queue>

namespace semrover {

namespace {

namespace fs = std::filesystem;

// of the same bytes with any value
constexpr std::string_view kWithoutEffect[] = {"--batch", "--threads"};

bool leads_through(const JobDrive& drive, const JobScene& scene)
{
    return drive.scenes.empty() || matches(drive.scenes, scene.name);
}

// Largest first, each to the part that has least
std::vector<const JobScene*> scenes_of_part(const JobFile& job, const TaskChoice& choice)
{
    std::vector<const JobScene*> order;
    for (const JobScene& scene : job.scenes)
        order.push_back(&scene);
    if (choice.parts == 1)
        return order;
    std::ranges::stable_sort(order, std::greater(), &JobScene::weight);
    using Part = std::pair<uint64_t, uint32_t>; // work so far, number
    std::priority_queue<Part, std::vector<Part>, std::greater<>> parts;
    for (uint32_t i = 0; i < choice.parts; ++i)
        parts.emplace(0, i);
    std::vector<const JobScene*> mine;
    for (const JobScene* scene : order) {
        const auto [work, part] = parts.top();
        parts.pop();
        parts.emplace(work + scene->weight + 1, part);
        if (part == choice.part)
            mine.push_back(scene);
    }
    return mine;
}

// of the names and bytes of all files in it, through all levels
Result<std::string> hash_tree(const Path& path)
{
    if (!is_folder(path))
        return hash_file(path).map(hash_text);
    SR_TRY(const std::vector<Path> files, list_tree(path));
    Hash all;
    for (const Path& file : files) {
        SR_TRY(const uint64_t one, hash_file(file));
        all.add(file.lexically_relative(path).generic_string());
        all.add(hash_text(one));
    }
    return hash_text(all.value());
}

} // namespace

std::string Task::name() const
{
    return drive ? fmt::format("drives/{}/{}", scene->name, drive->name) : fmt::format("scenes/{}", scene->name);
}

std::vector<Task> tasks_of(const JobFile& job, const TaskChoice& choice)
{
    std::vector<Task> tasks;
    const std::vector<const JobScene*> scenes = scenes_of_part(job, choice);
    for (const JobScene* scene : scenes)
        if (choice.scenes && scene->source != JobScene::Source::points)
            tasks.push_back({scene, nullptr});
    for (const JobScene* scene : scenes)
        for (const JobDrive& drive : job.drives)
            if (choice.drives && leads_through(drive, *scene))
                tasks.push_back({scene, &drive});
    return tasks;
}

uint64_t task_seed(const JobFile& job, const Task& task)
{
    Hash hash;
    hash.add(std::to_string(job.seed));
    hash.add(task.name());
    return hash.value();
}

Path scene_file(const JobFile& job, const JobScene& scene)
{
    return scene.source == JobScene::Source::points ? scene.file : job.out / "scenes" / scene.name / "scene.sgrid";
}

Path trajectory_of(const JobFile& job, const Task& task)
{
    if (task.drive->made)
        return job.out / "scenes" / task.scene->name / "street" / "drive.tum";
    std::string path = task.drive->path;
    if (const size_t at = path.find("{scene}"); at != std::string::npos)
        path.replace(at, 7, task.scene->name);
    return path;
}

Result<std::string> TaskKeys::hash(const Path& path)
{
    std::string& hash = hashes_[path];
    if (hash.empty()) {
        SR_TRY(hash, hash_tree(path));
    }
    return hash;
}

// files by what is in them
Result<Json> TaskKeys::options_json(const std::vector<JobOption>& options)
{
    std::map<std::string, std::string> values;
    for (const auto& [option, value] : options) {
        if (std::ranges::count(kWithoutEffect, option))
            continue;
        values[option] = value;
        if (Path(value).is_absolute() && is_file(value)) {
            SR_TRY(values[option], hash(value));
        }
    }
    return Json(values);
}

Result<Json> TaskKeys::scene_json(const JobScene& scene)
{
    SR_TRY(const std::string model, hash(job_.model));
    SR_TRY(const Json generate, options_json(job_.generate));
    SR_TRY(const Json streets, options_json(scene.streets));
    std::string labels, objects = scene.objects;
    if (!scene.file.empty()) {
        SR_TRY(labels, hash(scene.file));
    }
    if (Path(objects).is_absolute()) {
        SR_TRY(objects, hash(objects));
    }
    return Json{{"model", model},   {"generate", generate}, {"streets", streets},
                {"labels", labels}, {"objects", objects},   {"seed", task_seed(job_, {&scene, nullptr})}};
}

Result<Json> TaskKeys::drive_json(const Task& task)
{
    const JobScene& scene = *task.scene;
    const JobDrive& drive = *task.drive;
    Json json{{"refined", job_.refined},
              {"seed", task_seed(job_, task)},
              {"shards", job_.layout == JobLayout::shards},
              {"shard_bytes", job_.shard_bytes},
              {"buffers", job_.buffers},
              {"made", drive.made}};
    SR_TRY(json["options"], options_json(drive.options));
    if (scene.source == JobScene::Source::points) {
        SR_TRY(json["points"], hash(scene.file));
    } else {
        SR_TRY(json["scene"], key({&scene, nullptr}));
    }
    if (job_.refined) {
        SR_TRY(json["model"], hash(job_.model));
    }
    if (!drive.made) {
        SR_TRY(json["path"], hash(trajectory_of(job_, task)));
    }
    if (!drive.rig.empty()) {
        SR_TRY(json["rig"], hash(drive.rig));
    }
    return json;
}

Result<std::string> TaskKeys::key(const Task& task)
{
    SR_TRY(Json json, task.drive ? drive_json(task) : scene_json(*task.scene));
    json["version"] = kVersion;
    Hash hash;
    hash.add(json_text(json));
    return hash_text(hash.value());
}

} // namespace semrover
