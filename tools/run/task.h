// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/run/job_file.h"

namespace semrover {

// A piece of a job that is done and published as a whole.
struct Task {
    const JobScene* scene = nullptr;
    const JobDrive* drive = nullptr; // null: the scene is generated

    // the folder that it is published as, below the job's: "scenes/SCENE", "drives/SCENE/DRIVE"
    std::string name() const;
};

// Which of a job's tasks are meant
struct TaskChoice {
    uint32_t part = 0, parts = 1; // part of as many, from 0
    bool scenes = true, drives = true;
};

// In the order in which they are done: scenes, then drives. A scene and all its drives are in one part; parts are about
// as much work each, the same for every call.
std::vector<Task> tasks_of(const JobFile& job, const TaskChoice& choice);

// Recognises tasks: all that decides the bytes of what they publish, but the device.
class TaskKeys {
  public:
    explicit TaskKeys(const JobFile& job) : job_(job) {} // which outlives this

    // 16 hexadecimal digits. Errors: of the files that it reads
    Result<std::string> key(const Task& task);

  private:
    Result<Json> scene_json(const JobScene& scene);
    Result<Json> drive_json(const Task& task);
    Result<Json> options_json(const std::vector<JobOption>& options);
    Result<std::string> hash(const Path& file_or_folder);

    const JobFile& job_;
    std::map<Path, std::string> hashes_;
};

// of the scene's or the drive's, by its name: where its noise begins
uint64_t task_seed(const JobFile& job, const Task& task);

// the drive's trajectory: a file or folder
Path trajectory_of(const JobFile& job, const Task& task);
// what it leads through
Path scene_file(const JobFile& job, const JobScene& scene);

} // namespace semrover
