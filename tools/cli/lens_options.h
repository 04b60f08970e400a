// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/camera_path.h"

#include <span>

namespace CLI {
class App;
}

namespace semrover {

// the camera of a path that has none of its own
struct LensOptions {
    uint32_t width = 616, height = 424;
    bool size_given = false; // by -W or -H
    bool view_given = false; // by --fov-x
    double fov = 73.0;       // degrees: the focal length of the reference pictures, 420 pixels at a width of 616
    std::string camera_model = "pinhole", distortion;
};
void add_lens_options(CLI::App& command, LensOptions& options);
std::span<const std::string_view> lens_options(); // their names

Result<Intrinsics> intrinsics_of(const LensOptions& options); // usage
Result<PathLens> path_lens_of(const LensOptions& options);    // the same, and what of it was given; usage

} // namespace semrover
