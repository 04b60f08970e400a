// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/generation_settings.h"
#include "engine/job/job.h"
#include "engine/job/told_objects.h"
#include "engine/job/world_labels.h"
#include "engine/job/world_order.h"
#include "engine/scene/label_edits.h"
#include "engine/splat/splat_pool.h"

namespace semrover {

// A street of any extent that is generated around a host's camera, in the order of tiles (docs/method.md §4.4): the
// bytes of a place depend on model, seed, labels and edits near it. Which way the camera came, what was dropped and how
// much was done at a time do not matter.
struct WorldRequest {
    GenerationSettings settings;                         // with tile_cells: GenerationOptions::tile_size
    std::shared_ptr<const Transformer> transformer = {}; // of the settings' model, shared; none: one of its own
    uint64_t seed = 0;
    GivenObjects objects = {}; // what the model is told; none: guessed of the source's labels, block by block
    Path cache = {};           // a folder that keeps finished tiles, for other sessions too; empty: none
    uint64_t host_bytes = 0;   // of tiles in memory; 0: no budget
    uint64_t splat_bytes = 0;  // of splats on the device, all allocated at the beginning; 0: none are made
    SurfelOptions surfels = {.auto_sigma = true};
    // metres from the focus within which a tile has a splat of each of its points. Up to twice as far it has one of
    // each half cell, and so on: half as many along each axis whenever the distance doubles (detail_of). 0: all
    // everywhere
    double detail_distance = 0;
    uint32_t tiles_at_once = 0; // that are generated together; 0: what suits the device. Does not change the bytes
};

struct WorldFigures {
    size_t wanted = 0, finished = 0; // tiles within the focus' radius, and those of them that are finished
    size_t in_memory = 0;            // tiles
    uint64_t host_bytes = 0;         // of these
    uint64_t generated = 0, loaded = 0, dropped = 0; // tiles so far: made, taken from the cache, forgotten
    bool full = false;                               // a budget has no room for more of what is wanted
};

class World {
  public:
    virtual ~World() = default;

    // What is wanted from now on. Tiles that are at work are finished first. Errors: usage for numbers that are not
    // finite, a radius that is not 0..2000 m or a place beyond 2^19 cells
    virtual Status focus(const WorldFocus& focus) = 0;

    // Works as long as the budget allows: one piece of work at least, and no piece that is expected not to fit, going
    // by those of its kind before. true: nothing is left to do for this focus. A step waits for what it submits if the
    // budget is timed. Errors: of the source, of the device; those tiles are tried again by the next step
    virtual Result<bool> step(const JobBudget& budget) = 0;

    // Sets labels, or takes cells away. Their tiles and those that see them are generated anew; what was finished of
    // them is gone at once. Errors: bad_input for cells beyond 2^20 and unknown labels; nothing is changed then
    virtual Status edit(const LabelEdits& edits) = 0;

    // cells of a finished tile that is in memory, or null: sorted, each with points. Valid until the next call.
    virtual const VoxelGrid* tile(const TileIndex& tile) const = 0;
    virtual std::vector<TileIndex> tiles_with_points() const = 0;
    virtual int32_t tile_cells() const = 0;
    virtual WorldFigures figures() const = 0;

    // splats of finished tiles, each made of the tile's own points; null without splat_bytes
    virtual const SplatPool* splats() const = 0;

    // waits until the cache has all that is finished
    virtual Status flush() = 0;
};

// Loads the model and compiles what it needs, so that no step does. The device outlives the world.
// Errors: usage, bad_input (settings, objects, the cache), out_of_memory
Result<std::unique_ptr<World>> open_world(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels,
                                          const JobCallbacks& callbacks = {});

} // namespace semrover
