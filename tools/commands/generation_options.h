// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/world/world.h"
#include "engine/world/world_objects.h"
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

// --dry-run: what World::estimate says, on standard output
void print_estimate(const Json& estimate, const Globals& globals);
// what was written, on standard output
void print_results(const Json& results, const Globals& globals);

} // namespace semrover
