// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/graph/plan.h"

#include <string>

namespace semrover {

// a line a pass: level (there is a barrier between levels), submit, shader, workgroups, tile, what it binds, what it
// reads and writes outside of the graph; sums at the end, of one run
std::string plan_text(const Plan& plan);

} // namespace semrover
