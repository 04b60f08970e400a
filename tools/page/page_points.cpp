// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/page/page.h"

#include "engine/scene/palette.h"
#include "engine/scene/scene_points.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kSteps = 65535;

ScenePoints centers_of(const VoxelGrid& grid)
{
    ScenePoints out;
    for (size_t i = 0; i < grid.cells.size(); ++i) {
        out.positions.push_back(cell_center(grid.cells[i], grid.voxel_size));
        out.colors.push_back(label_color(grid.labels[i]));
        out.labels.push_back(grid.labels[i]);
    }
    return out;
}

// a surface of about a face a voxel, with all its points scattered on it: twice the spacing leaves
// 4% of it open
double diameter_of(const VoxelGrid& grid, const PagePoints& p)
{
    const double a_cell = p.centers ? 1 : double(grid.points_per_voxel);
    return (p.centers ? 1.2 : 2) * grid.voxel_size / std::sqrt(a_cell * double(p.count) / double(p.total));
}

void set_scale(PagePoints& p, const ScenePoints& points)
{
    for (size_t axis = 0; axis < 3; ++axis) {
        double low = points.positions[0][axis], high = low;
        for (const auto& position : points.positions) {
            low = std::min(low, double(position[axis]));
            high = std::max(high, double(position[axis]));
        }
        p.low[axis] = low;
        p.step[axis] = (high - low) / kSteps;
    }
}

} // namespace

PagePoints page_points(const VoxelGrid& grid, uint64_t limit)
{
    SR_ASSERT(limit > 0 && !grid.cells.empty(), "{} points of {} voxels", limit, grid.cells.size());
    ScenePoints points = points_of(grid);
    PagePoints p;
    p.centers = points.size() == 0;
    if (p.centers)
        points = centers_of(grid);
    p.total = points.size();
    p.count = std::min(p.total, limit);
    p.diameter = diameter_of(grid, p);
    set_scale(p, points);
    p.bytes.resize(p.count * 10);
    for (uint64_t i = 0; i < p.count; ++i) {
        const uint64_t from = i * p.total / p.count;
        for (size_t axis = 0; axis < 3; ++axis) {
            const double steps = (points.positions[from][axis] - p.low[axis]) / p.step[axis];
            const auto q = p.step[axis] > 0 ? uint16_t(std::lround(std::clamp(steps, 0.0, kSteps))) : uint16_t(0);
            p.bytes[6 * i + 2 * axis] = std::byte(q & 255);
            p.bytes[6 * i + 2 * axis + 1] = std::byte(q >> 8);
            p.bytes[6 * p.count + 3 * i + axis] = std::byte(std::lround(points.colors[from][axis] * 255));
        }
        p.bytes[9 * p.count + i] = std::byte(points.labels[from]);
    }
    return p;
}

} // namespace semrover
