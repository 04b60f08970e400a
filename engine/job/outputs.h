// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "engine/job/job.h"
#include "engine/job/run_folder.h"

namespace semrover {

// What cannot be written is refused now, not after an hour. usage when `path` exists and is not to be replaced;
// bad_input when it cannot be written
Status check_writable(const Path& path, bool replace);
bool is_written(const Path& path); // a file is there, as far as can be told

// Results of a run that is finished, with these settings (null: any); none where `folder` holds no such run.
std::optional<Json> finished_results(const Path& folder, const Json& settings);
// the same of a run that wrote `output`; none where that has other bytes than the run gave it (`xxh64`)
std::optional<Json> finished_results(const Path& folder, const Json& settings, const Path& output);

// Whether `folder` holds a run with these settings (null: any) that has not come to its end: what it may have written
// is its own
bool goes_on(const Path& folder, const Json& settings);

// The DriveRecord of a path beside its pictures; where it can have none, a warning says why
Status write_record_of(const CameraPath& path, double depth_unit, const Path& folder, const JobCallbacks& callbacks);

// The run folder of an output. With `replace`, a finished or different run there is started over, while an interrupted
// one with the same settings goes on. A finished one with the same settings starts over, too, unless `keep_finished`:
// then it is as it was, with RunFolder::results().
Result<RunFolder> open_run(const Path& folder, const Json& settings, bool replace, const RunContents& contents = {},
                           bool keep_finished = false);

} // namespace semrover
