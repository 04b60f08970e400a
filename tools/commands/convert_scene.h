// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/commands/scene_input.h"

namespace semrover {

// a scene in another format: grids to grids and splats, splats to splats and points
struct ConvertSceneOptions {
    std::string in, out, to;
    std::string up; // "y": of splats in .ply and .splat, as their viewers expect it; else the world's axes
    SceneInputOptions input;
    std::string splat_radius = "0.04";
    float opacity = 1;
    bool splat_labels = false, dry_run = false;
};
Status convert_scene(const ConvertSceneOptions& options, const Globals& globals);

} // namespace semrover
