// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/bench/plan_text.h"

#include <fmt/format.h>

namespace semrover {

namespace {

std::string tile_text(const Pass& pass)
{
    const Tile& tile = pass.grid.tile;
    if (pass.grid.unit != Grid::Unit::tiles)
        return {};
    std::string text = fmt::format("{}x{}", tile.rows, tile.cols);
    if (const size_t count = pass.options.alternatives.size(); count > 1)
        text += fmt::format(" of {}", count);
    return text;
}

double bound_mib(const Pass& pass)
{
    uint64_t bytes = 0;
    for (const PassBinding& b : pass.bindings)
        bytes += b.bytes;
    return double(bytes) / (1 << 20);
}

} // namespace

std::string plan_text(const Plan& plan)
{
    std::string text = fmt::format("{:>5} {:>6} {:24} {:>16} {:>13} {:>9} {:>9}  outside\n", "level", "submit",
                                   "shader", "workgroups", "tile", "MiB", "GFLOP");
    std::vector<uint32_t> submits(plan.passes.size()); // of a pass's first workgroups
    for (const Dispatch& d : plan.dispatches)
        if (!d.base[0] && !d.base[1] && !d.base[2])
            submits[d.pass] = d.submit;
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        const Pass& pass = plan.passes[i];
        const uint32_t* n = pass.group_count;
        text += fmt::format("{:5} {:6} {:24} {:>16} {:>13} {:9.2f} {:9.3f} ", pass.level, submits[i], pass.name(),
                            fmt::format("{}x{}x{}", n[0], n[1], n[2]), tile_text(pass), bound_mib(pass),
                            pass.options.flops / 1e9);
        for (const PassBinding& b : pass.bindings)
            if (b.given() && plan.resources[b.resource].external)
                text += fmt::format(" {}", plan.resources[b.resource].name);
        text += '\n';
    }
    return text + fmt::format("{} passes, {} taken over by others, {} dispatches, {} barriers, {} submits, {:.1f} MiB of arena\n",
                              plan.passes.size(), plan.fused, plan.dispatches.size(), plan.barriers(), plan.submits,
                              double(plan.arena_bytes()) / (1 << 20));
}

} // namespace semrover
