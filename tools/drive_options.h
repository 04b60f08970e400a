// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/path_drawing.h"
#include "tools/cli/lens_options.h"

namespace semrover {

// how a grid is driven through and drawn: what `render` and `refine` share
struct DriveOptions : LensOptions {
    std::string path, rig, background = "0,0,0";
    std::string splat_radius; // empty: not given
    bool equirect = false;    // panoramas of width x width / 2 in place of the path's cameras
    float opacity = 1;
    std::optional<float> visible_alpha;
};
void add_drive_options(CLI::App& command, DriveOptions& options);

// of `--splat-radius` (empty: 0.04) and `--opacity`; usage
Result<SurfelOptions> surfel_options(const std::string& splat_radius, float opacity);

// what can be said without a look at a file; usage
Result<DrawOptions> draw_options(const DriveOptions& options);
// the path, through the rig if any
Result<CameraPath> load_cameras(const DriveOptions& options);

} // namespace semrover
