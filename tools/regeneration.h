// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/generation.h"

namespace semrover {

// a grid of which some cells are to be generated anew, all the rest staying byte for byte: the end of edit and inpaint
struct Regeneration {
    std::string command; // "edit"
    Path input;          // the file that `before` was read from
    VoxelGrid before;
    VoxelGrid grid;                // what is written, but for the targets
    std::vector<uint32_t> targets; // ascending indices into `grid`
    Json request;                  // what was asked for, for the settings of the run
    Json counts;                   // for the report
};

struct RegenerationOptions {
    std::string output;
    std::vector<uint64_t> seeds; // several: OUT-seedN.sgrid each
    std::optional<uint64_t> seed;
    GenerationOptions generation; // an empty model: targets are left with generated = 0
};
void add_regeneration_options(CLI::App& command, RegenerationOptions& options);

std::vector<uint64_t> seeds_of(const RegenerationOptions& options);
// OUT.sgrid, or OUT-seedN.sgrid where there are several seeds
Path output_of(const RegenerationOptions& options, uint64_t seed);

// usage, bad_input: an output that is missing, exists, is the input or cannot be written; before any work
Status check_outputs(const Path& input, const RegenerationOptions& options, const Globals& globals);

// writes each seed's grid, OUTPUT.undo beside it, and keeps the state of its run in OUTPUT.run
Status regenerate(const Regeneration& what, const RegenerationOptions& options, const Globals& globals);

} // namespace semrover
