// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"
#include "tools/cli/commands.h"

namespace semrover {

// The device that --device, --require and --max-vram ask for, or that the session has; with a profile, it measures what
// runs on it. statistics: its pipelines keep what the driver says of their code, as they do with a profile.
Result<std::shared_ptr<Device>> open_device(const Globals& globals, const std::string& profile = {},
                                            bool statistics = false);

// --profile: a Chrome trace, and with --verbose a summary; nothing where `path` is empty
Status write_profile(Device& device, const std::string& path, const Globals& globals);

} // namespace semrover
