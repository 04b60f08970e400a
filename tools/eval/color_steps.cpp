// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/color_steps.h"

#include "engine/scene/tiles.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

std::array<double, 3> mean_color(const VoxelGrid& grid, size_t cell)
{
    std::array<double, 3> mean{};
    const size_t n = size_t(grid.points_per_voxel);
    for (size_t p = 0; p < n; ++p)
        for (size_t c = 0; c < 3; ++c)
            mean[c] += double(grid.colors[(cell * n + p) * 3 + c]) / double(n);
    return mean;
}

} // namespace

double ColorSteps::deviation() const
{
    return pairs ? std::sqrt(std::max(0.0, squares / double(pairs) - mean() * mean())) : 0;
}

SeamSteps seam_steps(const VoxelGrid& grid, int32_t edge)
{
    SeamSteps steps;
    if (!grid.has_points())
        return steps;
    for (size_t a = 0; a < grid.cells.size(); ++a)
        for (size_t axis = 0; axis < 2; ++axis) {
            Cell next = grid.cells[a];
            ++next[axis];
            const auto b = find_cell(grid, next);
            if (!b || grid.labels[a] != grid.labels[*b] || !grid.generated[a] || !grid.generated[*b])
                continue;
            const auto from = mean_color(grid, a), to = mean_color(grid, *b);
            double step = 0;
            for (size_t c = 0; c < 3; ++c)
                step += std::abs(from[c] - to[c]) / 3;
            (tile_of(grid.cells[a], edge) == tile_of(next, edge) ? steps.inside : steps.across).add(step);
        }
    return steps;
}

} // namespace semrover
