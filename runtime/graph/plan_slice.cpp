// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// stage 7: cuts passes into bands of rows where a binding exceeds what the device can bind; then counts workgroups
#include "runtime/graph/plan_bands.h"

#include <algorithm>
#include <iterator>

namespace semrover::stage {

namespace {

// of a row, where one dimension does not hold all workgroups: short, as rows are what a schedule can cut then
constexpr uint32_t kFoldedGroups = 4096;

} // namespace

Status count_groups(Pass& pass, const DeviceLimits& limits)
{
    uint32_t* n = pass.group_count;
    n[0] = pass.grid.x;
    n[1] = pass.grid.y;
    n[2] = pass.grid.z;
    const auto &m = pass.tile_rows, &k = pass.tile_cols;
    if (pass.grid.unit == Grid::Unit::tiles) {
        SR_ASSERT(m && k, "{}: a grid of tiles needs kTileM and kTileN", pass.kernel->name);
        n[0] = divide_up(pass.grid.x, *m);
        n[1] = divide_up(pass.grid.y, *k);
    } else if (pass.grid.unit != Grid::Unit::groups) {
        SR_ASSERT(m || pass.grid.unit == Grid::Unit::threads, "{}: a grid of row tiles needs kTileM",
                  pass.kernel->name);
        n[0] = divide_up(pass.grid.x, pass.grid.unit == Grid::Unit::threads ? pass.variant->local_size[0] : *m);
        if (n[0] > limits.max_groups)
            n[1] = divide_up(n[0], std::min(limits.max_groups, kFoldedGroups)); // the shader's linear_group() undoes it
        n[0] = divide_up(n[0], n[1]);
    }
    for (int i = 0; i < 3; ++i)
        if (n[i] == 0 || n[i] > limits.max_groups)
            return fail(ErrorCode::out_of_memory, "{}: {} workgroups in dimension {}, the device takes 1..{}",
                        pass.kernel->name, n[i], i, limits.max_groups);
    return {};
}

Status slice(Plan& plan, const DeviceLimits& limits)
{
    std::vector<Pass> passes;
    for (const Pass& pass : plan.passes) {
        SR_TRY(const uint32_t band, band_rows(plan, pass, limits));
        if (band == rows_of(pass))
            passes.push_back(pass);
        else
            std::ranges::move(bands_of(pass, band, limits), std::back_inserter(passes));
    }
    for (Pass& pass : passes)
        SR_CHECK(count_groups(pass, limits));
    plan.passes = std::move(passes);
    return {};
}

} // namespace semrover::stage
