// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/commands/generation_options.h"
#include "tools/editing/editing.h"

namespace semrover {

// what edit and inpaint share
struct RegenerationArguments {
    std::string output, objects; // objects: empty: the file beside the grid, else auto
    std::vector<uint64_t> seeds; // several: OUTPUT-seedN.sgrid each
    std::optional<uint64_t> seed;
    GenerationArguments generation; // an empty model: targets are left without points
};
void add_regeneration_options(CLI::App& command, RegenerationArguments& o);

// before any work: what cannot be written, and options that exclude each other
Status check_outputs(const Path& input, const RegenerationArguments& o, const Globals& globals);
Result<GivenObjects> objects_of(const Path& grid, const RegenerationArguments& o);

// Generates the targets for each seed in turn, and writes OUTPUT, OUTPUT.undo, which takes it back, and OUTPUT.run, the
// run's state. Seeds that an earlier start of the same request finished, and an interrupted one, are taken over
Status regenerate(const Regeneration& what, const RegenerationArguments& o, const Globals& globals);

} // namespace semrover
