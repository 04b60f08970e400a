// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/format/picture_encoding.h"
#include "engine/format/ply.h"
#include "engine/job/scene_actors.h"
#include "engine/scene/grid.h"

namespace semrover {

// how points become pictures
struct DrawOptions {
    PointSplatOptions splats;
    std::array<uint8_t, 3> background{};
    std::optional<float> visible_alpha;    // alpha from which a pixel counts as visible; 0.5, or what a model says
    float screen_variance = 0.5f;          // pixels^2, of the screen filter; 0: none
    bool semantic = false;                 // in label colours; a grid without points as blocks
    bool instances = false;                // pictures of which object a pixel shows, too
    bool boxes = false;                    // and boxes of them, with `instances`
    std::vector<SceneObject> objects = {}; // of the scene, for instances and actors
    std::vector<Actor> actors = {};        // what moves

    RasterizerOptions rasterizer(const PictureEncoding& files = {}) const; // that keeps pixels as files have them
};

// splats on the device, and which of them move
struct DrawnScene {
    SplatScene splats;
    SceneActors actors = {};
};

// Splats of a grid, its points as generated or as DrawOptions::semantic says, with those of the actors. `name` is the
// grid's, for errors: bad_input for a grid without points, for actors and their files, and for objects that pictures of
// instances cannot hold (docs/formats.md §6.1); out_of_memory
Result<DrawnScene> splats_of(Device& device, const VoxelGrid& grid, const Path& name, const DrawOptions& options);
// The same of splats, which are of no object
Result<DrawnScene> splats_of(Device& device, const Splats& splats, const DrawOptions& options);

} // namespace semrover
