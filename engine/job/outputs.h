// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"

namespace semrover {

// What cannot be written is refused now, not after an hour. usage when `path` exists and is not to be replaced;
// bad_input when it cannot be written
Status check_writable(const Path& path, bool replace);

// The run folder of an output. With `replace`, a finished or different run there is started over, while an interrupted
// one with the same settings goes on.
Result<RunFolder> open_run(const Path& folder, const Json& settings, bool replace, const RunContents& contents = {});

} // namespace semrover
