// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/scene_points.h"

#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "runtime/base/dtype.h"

#include <algorithm>
#include <map>

namespace semrover {

ScenePoints points_of(const VoxelGrid& grid)
{
    ScenePoints out;
    const size_t n = size_t(grid.points_per_voxel);
    for (size_t cell = 0; grid.has_points() && cell < grid.cells.size(); ++cell) {
        if (!grid.generated[cell])
            continue;
        const std::array<float, 3> center = cell_center(grid.cells[cell], grid.voxel_size);
        for (size_t i = cell * n; i < (cell + 1) * n; ++i) {
            std::array<float, 3> p, c;
            for (size_t a = 0; a < 3; ++a) {
                p[a] = center[a] + half_to_float(grid.points[3 * i + a]);
                c[a] = float(grid.colors[3 * i + a]) / 255;
            }
            out.positions.push_back(p);
            out.colors.push_back(c);
            out.labels.push_back(grid.labels[cell]);
            out.cells.push_back(uint32_t(cell));
        }
    }
    return out;
}

namespace {

// of the points in a cube
struct PointSums {
    std::array<double, 3> position{}, color{};
    uint32_t cell = 0, owner = 0; // of the first
    uint32_t count = 0;

    void add(const ScenePoints& points, size_t i)
    {
        if (count++ == 0) {
            cell = points.cells[i];
            owner = points.owners.empty() ? 0 : points.owners[i];
        }
        for (size_t a = 0; a < 3; ++a) {
            position[a] += points.positions[i][a];
            color[a] += points.colors[i][a];
        }
    }
    std::array<float, 3> mean(const std::array<double, 3>& sum) const
    {
        return {float(sum[0] / count), float(sum[1] / count), float(sum[2] / count)};
    }
};

} // namespace

ScenePoints thinned(const ScenePoints& points, float edge)
{
    SR_ASSERT(edge > 0, "cubes of {} m", edge);
    std::map<std::pair<Cell, uint32_t>, PointSums> cubes;
    for (size_t i = 0; i < points.size(); ++i) {
        const auto& [x, y, z] = points.positions[i];
        cubes[{cell_at({x, y, z}, edge), points.labels[i]}].add(points, i);
    }
    ScenePoints out;
    for (const auto& [key, sums] : cubes) {
        out.positions.push_back(sums.mean(sums.position));
        out.colors.push_back(sums.mean(sums.color));
        out.labels.push_back(key.second);
        out.cells.push_back(sums.cell);
        if (!points.owners.empty())
            out.owners.push_back(sums.owner);
    }
    return out;
}

void color_by_label(ScenePoints& points)
{
    for (size_t i = 0; i < points.size(); ++i)
        points.colors[i] = label_color(points.labels[i]);
}

} // namespace semrover
