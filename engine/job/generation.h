// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/export_ply.h"
#include "engine/job/generation_settings.h"
#include "engine/job/job.h"
#include "engine/job/told_objects.h"
#include "engine/scene/grid.h"

namespace semrover {

// semantic grid to coloured points: what `generate` does
struct GenerationRequest {
    GenerationSettings settings;
    uint64_t seed = 0;
    Path output; // .sgrid to write, with the run's state in OUTPUT.run; empty: nothing is written
    PlyExports ply;
    bool replace = false; // what is at `output` and `ply`, and a finished run's state
    // of the file that the grid is from, to know an interrupted run by; none: of the grid itself
    std::optional<uint64_t> grid_hash = {};
    // What is known beside labels; empty: labels alone. A model that cannot be told of them is an error (bad_input).
    // Not given: where a model can be told, objects are guessed from the labels. With an output, the objects that the
    // model was told of are written beside it (objects_beside).
    GivenObjects objects = {};
};

class GenerationJob : public Job {
  public:
    virtual const VoxelGrid& grid() const = 0; // filled as far as it is done
};

// usage, bad_input: an output that exists or cannot be written
Status check_generation_outputs(const GenerationRequest& request);

// Fills the cells of `grid` that have no points. With an output, an interrupted run of the same request goes on. The
// device outlives the job, and other jobs may use it too. finish() gives cells, regions, seconds, planned_device_bytes,
// peak_device_bytes, output and xxh64. Errors: usage, bad_input (outputs, a grid that does not go with the model, a
// state of another run), out_of_memory
Result<std::unique_ptr<GenerationJob>>
begin_generation(Device& device, VoxelGrid grid, const GenerationRequest& request, const JobCallbacks& callbacks = {});

// what it would take, as GridFilling::estimate says it
Result<Json> estimate_generation(Device& device, VoxelGrid grid, const GenerationRequest& request,
                                 const JobCallbacks& callbacks = {});

} // namespace semrover
