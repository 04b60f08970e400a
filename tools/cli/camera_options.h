// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"
#include "tools/dataset/depth_image.h"
#include "tools/trajectory/camera_path.h"

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

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
// usage: its rig has lidars only, and `what` is of cameras
Status need_cameras(const CameraPath& path, std::string_view what);

// How a trajectory comes into the grid's world: one group of options of every command that reads a path.
// docs/formats.md §7.4
struct PathOptions {
    std::string world, relative_to, calibration, origin;

    bool any() const { return !world.empty() || !relative_to.empty() || !calibration.empty() || !origin.empty(); }
};
// note: a command that has --calib or --origin for its other inputs keeps them, and hands them over itself; the path's
// origin is then --path-origin
void add_placement_options(CLI::App& command, PathOptions& options);
std::span<const std::string_view> placement_options(); // their names

nlohmann::json json_of(const PathOptions& options); // those that are given, for a run's settings

Result<PathPlacement> placement_of(const PathOptions& options); // usage; bad_input

// --origin X,Y,Z
void add_origin(CLI::App& command, std::string& text);

// bad use for what is not three numbers; 0, 0, 0 where the text is empty
Result<std::array<double, 3>> origin_from(const std::string& text);

// --depth-kind and --depth-scale, or of other pictures: how they hold depth
void add_depth_options(CLI::App& command, DepthEncoding& encoding, const std::string& of = "depth");

std::string_view name_of(std::optional<DepthKind> kind); // "auto" where there is none

} // namespace semrover
