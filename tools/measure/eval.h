// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/cli/commands.h"

namespace semrover {

// subcommands of `semrover eval`
void add_eval_chamfer(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_depth(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_edges(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_f3d(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_fid(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_flicker(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_frames(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_instances(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_kid(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_labels(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_mmd(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_points(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_seams(CLI::App& eval, const Globals& globals, Run& run);
void add_eval_surface(CLI::App& eval, const Globals& globals, Run& run);

} // namespace semrover
