// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <cstdint>
#include <functional>

namespace semrover {

// Called while weights are loaded, with the bytes that each of them took on the device; an error ends the loading. May
// be empty.
using LoadProgress = std::function<Status(uint64_t bytes)>;

} // namespace semrover
