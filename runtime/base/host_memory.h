// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace semrover {

// resident memory of this process in bytes, from /proc/self/status; 0 where there is none
struct HostMemory {
    uint64_t resident = 0, peak = 0;
};
HostMemory host_memory();

} // namespace semrover
