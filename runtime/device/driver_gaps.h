// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/device/device_choice.h"

#include <filesystem>

namespace semrover {

// what keeps a GPU, whose device files are there, from being a Vulkan device
struct DriverGap {
    std::string text;    // what is there, what is missing, what to do
    std::string package; // of Debian, that has it; may be empty
};

// What containers often lack of the drivers of their GPUs, by files and variables alone. `manifests` are those of
// LoaderSummary, `root` is where dev, sys, lib and usr lie: "/", or a test's.
std::vector<DriverGap> find_driver_gaps(const std::vector<std::string>& manifests, const std::filesystem::path& root,
                                        const Environment& environment);

} // namespace semrover
