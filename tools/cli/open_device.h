// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/run_folder.h"
#include "runtime/device/device.h"
#include "tools/cli/commands.h"

namespace semrover {

// the device that --device and --max-vram ask for
Result<std::unique_ptr<Device>> open_device(const Globals& globals);

// the run folder of an output; with `replace` (-y) a finished or different run there is started over, while an
// interrupted one with the same settings goes on
Result<RunFolder> open_run(const Path& folder, const Json& settings, bool replace, const RunContents& contents = {});

} // namespace semrover
