// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// semrover eval METRIC ..: how far apart two sets of results are, or a result and the truth
#include "tools/measure/eval.h"

#include <CLI/CLI.hpp>

namespace semrover {

void add_eval(CLI::App& app, const Globals& globals, Run& run)
{
    CLI::App* eval =
        app.add_subcommand("eval", "measure how far apart two sets of results are, or a result and the truth");
    eval->require_subcommand(1);
    eval->fallthrough();
    add_eval_chamfer(*eval, globals, run);
    add_eval_depth(*eval, globals, run);
    add_eval_edges(*eval, globals, run);
    add_eval_f3d(*eval, globals, run);
    add_eval_fid(*eval, globals, run);
    add_eval_flicker(*eval, globals, run);
    add_eval_frames(*eval, globals, run);
    add_eval_instances(*eval, globals, run);
    add_eval_kid(*eval, globals, run);
    add_eval_labels(*eval, globals, run);
    add_eval_mmd(*eval, globals, run);
    add_eval_points(*eval, globals, run);
    add_eval_seams(*eval, globals, run);
    add_eval_surface(*eval, globals, run);
}

} // namespace semrover
