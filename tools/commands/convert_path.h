// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/file.h"
#include "tools/cli/commands.h"
#include "tools/cli/lens_options.h"
#include "tools/cli/path_options.h"

namespace semrover {

// trajectories of any format that is read to TUM, KITTI, nerfstudio's two and COLMAP's text model
struct ConvertPathOptions {
    PathOptions placement;
    LensOptions lens;   // where the path has none
    std::string format; // of the result; empty: by its name
    std::string camera; // only this one's frames
    std::string rig;    // every sensor at every pose
    std::string points; // a grid, whose points go along
    std::string images; // a folder of `render` or `refine`, whose pictures go along
};
void add_path_options(CLI::App& command, ConvertPathOptions& options);

// is this a trajectory, and not a scene or a model? By what it holds, and of a file that is not there by its name
bool is_camera_path(const Path& path);

// bad_input, for what is no path, no scene and no model: what it looks like, and what was expected
Status refuse_unknown_input(const Path& path);

// errors: usage; bad_input, and then nothing was written
Status convert_path(const Path& in, const Path& out, const ConvertPathOptions& options, bool dry_run,
                    const Globals& globals);

} // namespace semrover
