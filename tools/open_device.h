// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device.h"
#include "tools/commands.h"

namespace semrover {

// the device that --device and --max-vram ask for
Result<std::unique_ptr<Device>> open_device(const Globals& globals);

} // namespace semrover
