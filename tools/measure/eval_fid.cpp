// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval fid A B --features inception.safetensors: Frechet Inception distance of two sets of images
#include "tools/measure/eval.h"
#include "tools/measure/eval_frechet.h"

#include <CLI/CLI.hpp>

namespace semrover {

void add_eval_fid(CLI::App& eval, const Globals& globals, Run& run)
{
    auto o = std::make_shared<EvalOptions>();
    CLI::App* c = eval.add_subcommand("fid", "Frechet Inception distance of two sets of images");
    add_eval_options(*c, *o);
    c->callback(
        [o, &globals, &run] { run = [o, &globals] { return eval_frechet(*o, "fid", EvalNetwork::images, globals); }; });
}

} // namespace semrover
