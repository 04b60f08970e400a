// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/json.h"
#include "runtime/device/device.h"

namespace semrover {

// What of a device decides bytes, for the settings of runs: name, driver, and which kernels it gets
inline Json device_key(const Device& device)
{
    return {{"device", device.name()}, {"driver", device.driver()}, {"kernels", kernels_text(device.limits())}};
}

} // namespace semrover
