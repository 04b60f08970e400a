// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/regeneration.h"
#include "tools/cli/commands.h"

namespace semrover {

// what generate, edit and inpaint share
struct GenerationArguments {
    GenerationOptions options;
    std::string profile;
    bool dry_run = false;
};
// boxes and colours that condition a model: a file, "auto" (guessed of labels) or "none"
Result<GivenObjects> given_objects(const std::string& option);

void add_generation_options(CLI::App& command, GenerationArguments& o);

// The end of each of them: opens the device and runs the job to its end, or, for --dry-run, says what it would take;
// then the profile and what goes to standard output.
using BeginOnDevice = std::function<Result<std::unique_ptr<Job>>(Device&, const JobCallbacks&)>;
using EstimateOnDevice = std::function<Result<Json>(Device&, const JobCallbacks&)>;
Status run_on_device(const GenerationArguments& o, const Globals& globals, const BeginOnDevice& begin,
                     const EstimateOnDevice& estimate);

// what edit and inpaint share
struct RegenerationArguments {
    std::string output, objects; // objects: empty: the file beside the grid, else auto
    std::vector<uint64_t> seeds;
    std::optional<uint64_t> seed;
    GenerationArguments generation; // an empty model: targets are left without points
};
void add_regeneration_options(CLI::App& command, RegenerationArguments& o);

// before any work: what cannot be written, and options that exclude each other
Status check_outputs(const Path& input, const RegenerationArguments& o, const Globals& globals);
Result<GivenObjects> objects_of(const Path& grid, const RegenerationArguments& o);
Status regenerate(Regeneration what, const RegenerationArguments& o, const Globals& globals);

} // namespace semrover
