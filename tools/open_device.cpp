// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/open_device.h"

namespace semrover {

Result<std::unique_ptr<Device>> open_device(const Globals& globals)
{
    DeviceOptions options;
    options.select = globals.device;
    options.max_bytes = globals.max_vram;
    return Device::create(options);
}

} // namespace semrover
