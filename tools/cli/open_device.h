// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"
#include "tools/cli/commands.h"

namespace semrover {

// the device that --device, --require and --max-vram ask for; with a profile, it measures what runs on it
Result<std::unique_ptr<Device>> open_device(const Globals& globals, const std::string& profile = {});

// --profile: a Chrome trace, and with --verbose a summary; nothing where `path` is empty
Status write_profile(Device& device, const std::string& path, const Globals& globals);

} // namespace semrover
