// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"

namespace semrover {

// How the world of a camera path lies in that of a grid. In this order: poses become those relative to a frame, then
// the lidar's in place of the camera's, then `world` is applied, then `origin` is added to positions.
struct PathPlacement {
    static constexpr uint64_t kFirst = ~0ull;

    std::optional<uint64_t> relative_to;  // a frame: its number in the file or, where files give none, counted from 0
    std::optional<Rigid> lidar_to_camera; // KITTI's Tr; without relative_to, relative to the first frame
    Rigid world = kIdentity;              // the path's world to the grid's
    Point3 origin{};                      // where the path's origin lies in the grid's world
};

// bad_input, with `where` in front: no such frame; a lidar's calibration for poses that are no camera's
Status place_path(CameraPath& path, const PathPlacement& placement, std::string_view where);

} // namespace semrover
