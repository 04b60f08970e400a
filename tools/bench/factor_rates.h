// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device.h"

#include <functional>

namespace semrover {

// What bounds every tile: how fast matrix units are with factors in registers, and with those that come from shared
// memory and from caches, by operations a byte; and how fast memory is read, by size. Prints an object each, and a line
// each to stderr. divisor: of sizes, for a try. Of a device with matrix units; in_time: false ends it.
Status print_factor_rates(Device& device, uint32_t divisor, const std::function<bool()>& in_time);

} // namespace semrover
