// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"
#include "tools/run/task.h"

namespace semrover {

// What tasks would take, going by a trial: the smallest scene with one denoising step, and the first two moments of its
// drives, in a folder that is removed again. Figures: scenes, drives, frames, scene_seconds, drive_seconds, seconds,
// bytes and files that are published, device_bytes at most, device. Errors: the commands'
Result<Json> estimate(const JobFile& job, const std::vector<Task>& tasks, const Globals& globals);

} // namespace semrover
