// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/scene_points.h"

#include "engine/scene/palette.h"
#include "runtime/dtype.h"

#include <algorithm>

namespace semrover {

namespace {

std::array<float, 3> label_color(uint32_t label)
{
    const auto& c = kPalette[std::min<size_t>(label, kClassCount - 1)].color;
    return {float(c[0]) / 255, float(c[1]) / 255, float(c[2]) / 255};
}

void add(ScenePoints& out, const std::array<float, 3>& position, const std::array<float, 3>& color, uint32_t label, size_t cell)
{
    out.positions.push_back(position);
    out.colors.push_back(color);
    out.labels.push_back(label);
    out.cells.push_back(uint32_t(cell));
}

void add_face(ScenePoints& out, const VoxelGrid& grid, size_t cell, int axis, int side)
{
    const std::array<float, 3> center = cell_center(grid.cells[cell], grid.voxel_size);
    for (int u = -1; u <= 1; ++u)
        for (int v = -1; v <= 1; ++v) {
            std::array<float, 3> p = center;
            p[size_t(axis)] += float(side) * grid.voxel_size * 0.499f; // inside the cell: neighbours do not tie in depth
            p[size_t(axis + 1) % 3] += float(u) * grid.voxel_size / 3;
            p[size_t(axis + 2) % 3] += float(v) * grid.voxel_size / 3;
            add(out, p, label_color(grid.labels[cell]), grid.labels[cell], cell);
        }
}

} // namespace

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
            add(out, p, c, grid.labels[cell], cell);
        }
    }
    return out;
}

ScenePoints blocks_of(const VoxelGrid& grid)
{
    ScenePoints out;
    for (size_t cell = 0; cell < grid.cells.size(); ++cell)
        for (int axis = 0; axis < 3; ++axis)
            for (int side : {-1, 1}) {
                Cell neighbor = grid.cells[cell];
                neighbor[size_t(axis)] += side;
                if (!find_cell(grid, neighbor))
                    add_face(out, grid, cell, axis, side);
            }
    return out;
}

void color_by_label(ScenePoints& points)
{
    for (size_t i = 0; i < points.size(); ++i)
        points.colors[i] = label_color(points.labels[i]);
}

Bounds bounds_of(const VoxelGrid& grid)
{
    Bounds b{{1e30, 1e30, 1e30}, {-1e30, -1e30, -1e30}};
    for (const Cell& cell : grid.cells)
        for (size_t a = 0; a < 3; ++a) {
            b.low[a] = std::min(b.low[a], double(cell[a]) * grid.voxel_size);
            b.high[a] = std::max(b.high[a], double(cell[a] + 1) * grid.voxel_size);
        }
    return b;
}

} // namespace semrover
