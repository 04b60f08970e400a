// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/trajectory/camera_path.h"

#include <span>

namespace CLI {
class App;
}

namespace semrover {

// the camera of a path that has none of its own
struct LensOptions {
    uint32_t width = 616, height = 424;
    bool size_given = false; // by -W or -H
    bool width_given = false, height_given = false;
    bool lens_given = false; // by --fov-x or --camera-model
    bool view_given = false; // by --fov-x
    double fov = 73.0;       // degrees: the focal length of the reference pictures, 420 pixels at a width of 616
    std::string camera_model = "pinhole", distortion;
};
void add_lens_options(CLI::App& command, LensOptions& options);
std::span<const std::string_view> lens_options(); // their names

Result<Intrinsics> intrinsics_of(const LensOptions& options); // usage
Result<PathLens> path_lens_of(const LensOptions& options);    // the same, and what of it was given; usage

// A trajectory as read_camera_path reads it, or the cameras of a rig (empty: none) along it. -W and -H are the size of
// every picture. Cameras that bring their own along are scaled to it and see what they saw; with one of both, the other
// follows from the shape of each camera's picture. Errors: usage for another lens than what the cameras have; as the
// readers say
Result<CameraPath> read_cameras(const Path& path, const Path& rig, const LensOptions& options,
                                const PathPlacement& placement);

} // namespace semrover
