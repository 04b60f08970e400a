// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval: measures of what was made
#include "tools/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

void add_eval(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* c = app.add_subcommand("eval", "measure what was made: chamfer");
    c->require_subcommand(1);
    c->fallthrough();
    add_eval_chamfer(*c, globals, run);
}

} // namespace semrover
