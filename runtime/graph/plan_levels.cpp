// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 3: which passes may run side by side, from what they read and write, before any memory is shared
#include "runtime/graph/plan.h"

#include <algorithm>

namespace semrover::stage {

namespace {

// level of each pass: one after the last that it conflicts with
std::vector<uint32_t> earliest_levels(const Plan& plan, const std::vector<std::vector<uint32_t>>& before)
{
    std::vector<uint32_t> level(plan.passes.size(), 0);
    for (size_t i = 0; i < level.size(); ++i)
        for (uint32_t k : before[i])
            level[i] = std::max(level[i], level[k] + 1);
    return level;
}

// Passes with slack run as late as what needs them allows: what they make is then alive for the shortest time. Those
// that nothing in the graph needs stay early.
void defer(std::vector<uint32_t>& level, const std::vector<std::vector<uint32_t>>& before)
{
    std::vector<uint32_t> latest(level.size(), ~0u);
    for (size_t i = level.size(); i-- > 0;) {
        if (latest[i] != ~0u)
            level[i] = latest[i];
        for (uint32_t k : before[i])
            latest[k] = std::min(latest[k], level[i] - 1);
    }
}

} // namespace

void levels(Plan& plan, bool side_by_side)
{
    for (uint32_t i = 0; i < plan.passes.size(); ++i)
        plan.passes[i].level = i;
    if (!side_by_side)
        return;
    std::vector<std::vector<uint32_t>> before(plan.passes.size());
    for (uint32_t i = 0; i < plan.passes.size(); ++i)
        for (uint32_t k = 0; k < i; ++k)
            if (conflict(plan, plan.passes[k], plan.passes[i]))
                before[i].push_back(k);
    std::vector<uint32_t> level = earliest_levels(plan, before);
    defer(level, before);
    for (uint32_t i = 0; i < plan.passes.size(); ++i)
        plan.passes[i].level = level[i];
    std::ranges::stable_sort(plan.passes, {}, &Pass::level);
}

} // namespace semrover::stage
