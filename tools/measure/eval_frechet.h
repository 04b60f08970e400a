// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/measure/eval_sets.h"

namespace semrover {

// the Frechet distance of two sets, printed under the metric's name
Status eval_frechet(const EvalOptions& options, std::string_view metric, EvalNetwork network, const Globals& globals);

} // namespace semrover
