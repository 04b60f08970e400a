// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

namespace CLI {
class App;
}

namespace semrover {

// the camera of a path that has none of its own
struct LensOptions {
    uint32_t width = 616, height = 424;
    bool size_given = false; // by -W or -H
    double fov = 73.0;       // degrees: the focal length of the reference pictures, 420 pixels at a width of 616
    std::string camera_model = "pinhole", distortion;
};
void add_lens_options(CLI::App& command, LensOptions& options);

Result<Intrinsics> intrinsics_of(const LensOptions& options); // usage

} // namespace semrover
