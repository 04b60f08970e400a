// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/path_drawing.h"
#include "tools/cli/camera_options.h"
#include "tools/cli/commands.h"

namespace semrover {

// how a grid is driven through and drawn: what `render` and `refine` share
struct TrajectoryOptions : LensOptions {
    PathOptions placement;
    std::string path, rig, background = "0,0,0";
    std::string splat_radius; // empty: not given
    Path objects;             // empty: those beside the grid
    Path actors;              // empty: none
    bool instances = false, boxes = false;
    bool equirect = false; // panoramas of width x width / 2 in place of the path's cameras
    float opacity = 1, screen_variance = 0.5f;
    bool allow_empty = false; // frames that all see nothing are no error
    std::optional<float> visible_alpha;
};
void add_trajectory_options(CLI::App& command, TrajectoryOptions& options);

// of `--splat-radius` (empty: 0.04) and `--opacity`; usage
Result<PointSplatOptions> point_splat_options(const std::string& splat_radius, float opacity);

// what can be said without a look at a file, and the objects of `grid` where instances are drawn. Errors: usage;
// bad_input, of the objects
Result<DrawOptions> draw_options(const TrajectoryOptions& options, const Path& grid);
// the path, in the grid's world, through the rig if any; warnings are in it
Result<CameraPath> load_cameras(const TrajectoryOptions& options);

} // namespace semrover
