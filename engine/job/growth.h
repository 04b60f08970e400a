// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/path_placement.h"
#include "engine/job/generation_settings.h"
#include "engine/job/job.h"
#include "engine/job/told_objects.h"
#include "engine/scene/path_windows.h"
#include "engine/scene/tile_cache.h"

namespace semrover {

// What `generate --along` does: grows a scaffold along a camera path, window by window, with everything generated
// before as known context; only the tiles around the window are in memory.
struct GrowthRequest {
    GenerationOptions generation;
    Path scaffold;           // a .sgrid or a folder of tiles
    Path path;               // of the camera
    PathPlacement placement; // of it
    Path output;             // a folder of tiles, with the run's state in OUTPUT.run
    uint64_t seed = 0;
    double horizon = 30; // metres to either side and ahead
    double window = 10;  // metres of path at a time
    double tile_size = 38.4;
    GivenObjects objects = {}; // guessed of a scaffold that is one file; of a folder of tiles nothing is guessed
    bool replace = false;      // tiles that are in `output`, and a finished run's state
};

// a request with all that needs no device
struct GrowthPlan {
    GrowthRequest request;
    GenerationSettings settings;
    PathWindows windows;
    TileSource source;
    std::vector<SceneObject> objects; // that the model is told of
};

// Reads the model's description, the path and the index of the scaffold. writes: false where only an estimate is
// wanted; the output may then exist. Errors: usage, bad_input
Result<GrowthPlan> plan_growth(const GrowthRequest& request, bool writes = true);

// An interrupted run of the same request goes on. The device outlives the job. finish() gives metres, windows, tiles,
// cells, regions, seconds, memory, and the same figures for each hundred metres as legs.
// Errors: usage, bad_input (the output, a damaged run), out_of_memory
Result<std::unique_ptr<Job>> begin_growth(Device& device, GrowthPlan plan, const JobCallbacks& callbacks = {});

// walks through the windows as if they had been filled: metres, windows, cells, regions, peak_device_bytes, device
Result<Json> estimate_growth(Device& device, GrowthPlan plan, const JobCallbacks& callbacks = {});

} // namespace semrover
