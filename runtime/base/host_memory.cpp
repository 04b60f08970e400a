// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/host_memory.h"

#include <fstream>
#include <string>

namespace semrover {

HostMemory host_memory()
{
    HostMemory memory;
    std::ifstream status("/proc/self/status");
    std::string key;
    while (status >> key) {
        uint64_t kibibytes = 0;
        if (key == "VmHWM:" && status >> kibibytes)
            memory.peak = kibibytes * 1024;
        else if (key == "VmRSS:" && status >> kibibytes)
            memory.resident = kibibytes * 1024;
        status.clear();
        std::getline(status, key);
    }
    return memory;
}

} // namespace semrover
