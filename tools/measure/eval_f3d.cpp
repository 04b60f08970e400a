// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval f3d A B --features pointnet2.safetensors: Frechet distance of two sets of grids
#include "tools/measure/eval.h"
#include "tools/measure/eval_frechet.h"

#include <CLI/CLI.hpp>

namespace semrover {

void add_eval_f3d(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalOptions>();
    CLI::App* c = eval.add_subcommand("f3d", "Frechet distance of PointNet++ features of two sets of grids");
    add_eval_options(*c, *o);
    c->callback(
        [o, &globals, &run] { run = [o, &globals] { return eval_frechet(*o, "f3d", EvalNetwork::points, globals); }; });
}

} // namespace semrover
