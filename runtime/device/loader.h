// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace semrover {

// what of Vulkan is installed, as the loader sees it; asks no driver
struct LoaderSummary {
    std::string api;                  // the loader's own version; empty when it does not answer
    std::vector<std::string> drivers; // manifest files of installed drivers
    bool validation = false;          // the Khronos layer is there
};

LoaderSummary describe_loader();

} // namespace semrover
