// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/generation_settings.h"
#include "engine/job/job.h"
#include "engine/job/told_objects.h"
#include "engine/scene/grid.h"

namespace semrover {

// a grid of which some cells are to be generated anew, all the rest staying byte for byte: the end of edit and inpaint
struct Regeneration {
    std::string command; // "edit"
    Path input;          // the file that `before` was read from
    VoxelGrid before;
    VoxelGrid grid;                // what is written, but for the targets
    std::vector<uint32_t> targets; // ascending indices into `grid`
    GivenObjects objects = {};     // what a model is told; written beside each output (objects_beside)
    bool needs_objects = false;    // a model that cannot be told of them is an error
    Json request;                  // what was asked for, for the settings of the run
    Json counts;                   // for the report
};

struct RegenerationOutputs {
    Path output;                       // OUTPUT.undo beside it takes it back, OUTPUT.run keeps the run's state
    std::vector<uint64_t> seeds = {0}; // several: OUT-seedN.sgrid each
    bool replace = false;

    Path of(uint64_t seed) const;
};

// usage: a seed that is given twice
Status check_seeds(const std::vector<uint64_t>& seeds);
// usage, bad_input: an output that is missing, exists, is the input or cannot be written; before any work
Status check_regeneration_outputs(const Path& input, const RegenerationOutputs& outputs);

// Generates the targets for each seed in turn. Seeds that an earlier start of the same request finished, and an
// interrupted one, are taken over. The device outlives the job. finish() gives the counts, and `outputs`: of each seed
// output, undo, xxh64, seed, cells, regions, seconds and memory.
// Errors: usage, bad_input (outputs, a grid that does not go with the model), out_of_memory
Result<std::unique_ptr<Job>> begin_regeneration(Device& device, Regeneration what, const RegenerationOutputs& outputs,
                                                const GenerationSettings& settings, const JobCallbacks& callbacks = {});
// what it would take, as GridFilling::estimate says it
Result<Json> estimate_regeneration(Device& device, Regeneration what, const RegenerationOutputs& outputs,
                                   const GenerationSettings& settings, const JobCallbacks& callbacks = {});

// writes the grids with the targets left without points: what finish() gives
Result<Json> leave_without_points(const Regeneration& what, const RegenerationOutputs& outputs);

} // namespace semrover
