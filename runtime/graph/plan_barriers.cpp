// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 6: hazards from access x byte range, after aliasing. A pass runs one level after the last pass that it
// conflicts with; one barrier stands between levels, none for read after read.
#include "runtime/graph/plan.h"

#include <algorithm>

namespace semrover::stage {

void barriers(Plan& plan)
{
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        uint32_t level = 0;
        for (size_t k = 0; k < i; ++k) {
            const Pass& before = plan.passes[k];
            if (before.level >= level && conflict(plan, before, plan.passes[i]))
                level = before.level + 1;
        }
        plan.passes[i].level = level;
        plan.levels = std::max(plan.levels, level + 1);
    }
    std::stable_sort(plan.passes.begin(), plan.passes.end(),
                     [](const Pass& a, const Pass& b) { return a.level < b.level; });
}

} // namespace semrover::stage
