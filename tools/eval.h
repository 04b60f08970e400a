// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/commands.h"

namespace semrover {

// semrover eval KIND ...: measures of what was made; one file each
void add_eval(CLI::App& app, const Globals& globals, Run& run);

void add_eval_chamfer(CLI::App& eval, const Globals& globals, Run& run);

} // namespace semrover
