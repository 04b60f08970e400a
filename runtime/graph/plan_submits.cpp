// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 7: what goes to the device at a time. GPUs are taken away from whoever keeps them for too long, by a watchdog,
// so submits are short: passes share one until its time is used up, and a long pass is cut into ranges of its
// workgroups.
#include "runtime/graph/plan.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

// Ranges along one dimension. Workgroups that are folded over two find their number from the whole length of a row.
int cut_dimension(const Pass& pass)
{
    const uint32_t* n = pass.group_count;
    if (pass.grid.unit == Grid::Unit::threads || pass.grid.unit == Grid::Unit::row_tiles)
        return n[1] > 1 ? 1 : 0;
    return int(std::max_element(n, n + 3) - n);
}

uint32_t parts_of(const Pass& pass, int dimension, double seconds, double limit)
{
    if (limit <= 0 || seconds <= limit)
        return 1;
    return uint32_t(std::min(std::ceil(seconds / limit), double(pass.group_count[dimension])));
}

} // namespace

void stage::submits(Plan& plan, const DeviceLimits& limits, std::span<const double> seconds)
{
    const double limit = limits.submit_seconds;
    double filled = 0; // seconds of the submit so far
    uint32_t submit = 0;
    plan.dispatches.clear();
    for (uint32_t i = 0; i < plan.passes.size(); ++i) {
        const Pass& pass = plan.passes[i];
        const int dimension = cut_dimension(pass);
        const uint64_t parts = parts_of(pass, dimension, seconds[i], limit), groups = pass.group_count[dimension];
        for (uint64_t part = 0; part < parts; ++part) {
            Dispatch d{.pass = i};
            std::copy_n(pass.group_count, 3, d.count);
            d.base[dimension] = uint32_t(groups * part / parts);
            d.count[dimension] = uint32_t(groups * (part + 1) / parts) - d.base[dimension];
            const double cost = seconds[i] / double(parts);
            if (limit > 0 && filled > 0 && filled + cost > limit) {
                ++submit;
                filled = 0;
            }
            filled += cost;
            d.submit = submit;
            plan.dispatches.push_back(d);
        }
    }
    plan.submits = plan.passes.empty() ? 0 : submit + 1;
}

} // namespace semrover
