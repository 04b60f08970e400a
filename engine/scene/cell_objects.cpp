// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/cell_objects.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace semrover {

namespace {

double depth_in(const SceneObject& object, const std::array<double, 3>& point)
{
    const std::array<double, 3> p = place_in(object, point);
    double depth = std::numeric_limits<double>::infinity();
    for (size_t a = 0; a < 3; ++a)
        depth = std::min(depth, object.size[a] / 2 - std::abs(p[a]));
    return depth;
}

// of the sorted cells those that may belong to the object: a range of i
std::pair<size_t, size_t> cells_across(const VoxelGrid& grid, const SceneObject& object)
{
    const double half = std::hypot(object.size[0] / 2 + kObjectReach, object.size[1] / 2 + kObjectReach);
    const auto cell_of = [&](double x) { return std::floor(x / double(grid.voxel_size)); };
    const double low = cell_of(object.center[0] - half), high = cell_of(object.center[0] + half);
    const auto first = std::ranges::lower_bound(grid.cells, low, {}, [](const Cell& c) { return double(c[0]); });
    const auto last = std::ranges::upper_bound(grid.cells, high, {}, [](const Cell& c) { return double(c[0]); });
    return {size_t(first - grid.cells.begin()), size_t(last - grid.cells.begin())};
}

std::array<double, 3> median_color(const VoxelGrid& grid, std::span<const uint32_t> cells)
{
    const size_t values = size_t(grid.points_per_voxel) * 3;
    std::array<std::array<uint32_t, 256>, 3> counts{};
    for (uint32_t v : cells)
        for (size_t i = 0; i < values; ++i)
            ++counts[i % 3][grid.colors[v * values + i]];
    const uint64_t all = uint64_t(cells.size()) * uint64_t(grid.points_per_voxel);
    std::array<double, 3> color{};
    for (size_t c = 0; c < 3; ++c) {
        uint64_t below = 0;
        uint32_t level = 0;
        while ((below += counts[c][level]) * 2 < all)
            ++level;
        color[c] = level / 255.0;
    }
    return color;
}

} // namespace

std::array<double, 3> place_in(const SceneObject& object, const std::array<double, 3>& point)
{
    const double x = point[0] - object.center[0], y = point[1] - object.center[1];
    const double c = std::cos(object.heading), s = std::sin(object.heading);
    return {c * x + s * y, c * y - s * x, point[2] - object.center[2]};
}

std::vector<int32_t> objects_of_cells(const VoxelGrid& grid, std::span<const SceneObject> objects)
{
    const double size = double(grid.voxel_size);
    std::vector<int32_t> owners(grid.cells.size(), kNoObject);
    std::vector<double> depths(grid.cells.size(), -kObjectReach);
    for (size_t o = 0; o < objects.size(); ++o) {
        const auto [first, last] = cells_across(grid, objects[o]);
        for (size_t v = first; v < last; ++v) {
            if (grid.labels[v] != objects[o].label)
                continue;
            const Cell& c = grid.cells[v];
            const double depth = depth_in(objects[o], {(c[0] + 0.5) * size, (c[1] + 0.5) * size, (c[2] + 0.5) * size});
            if (depth > depths[v]) {
                depths[v] = depth;
                owners[v] = int32_t(o);
            }
        }
    }
    return owners;
}

std::vector<size_t> objects_meant(const VoxelGrid& grid, std::span<const SceneObject> objects,
                                  std::span<const uint32_t> cells)
{
    const std::vector<int32_t> owners = objects_of_cells(grid, objects);
    std::vector<size_t> all(objects.size()), chosen(objects.size()), meant;
    for (const int32_t owner : owners)
        if (owner != kNoObject)
            ++all[size_t(owner)];
    for (const uint32_t cell : cells)
        if (owners[cell] != kNoObject)
            ++chosen[size_t(owners[cell])];
    for (size_t o = 0; o < objects.size(); ++o)
        if (chosen[o] * 2 > all[o])
            meant.push_back(o);
    const auto most = std::ranges::max_element(chosen);
    if (meant.empty() && most != chosen.end() && *most > 0)
        meant.push_back(size_t(most - chosen.begin()));
    return meant;
}

void tint_objects(std::span<SceneObject> objects, const VoxelGrid& grid)
{
    if (!grid.has_points())
        return;
    const std::vector<int32_t> owners = objects_of_cells(grid, objects);
    std::vector<uint32_t> cells;
    for (uint32_t v = 0; v < owners.size(); ++v)
        if (owners[v] != kNoObject && grid.generated[v])
            cells.push_back(v);
    std::ranges::stable_sort(cells, {}, [&](uint32_t v) { return owners[v]; });
    for (size_t first = 0, last; first < cells.size(); first = last) {
        const int32_t owner = owners[cells[first]];
        for (last = first; last < cells.size() && owners[cells[last]] == owner;)
            ++last;
        objects[size_t(owner)].tint = median_color(grid, std::span(cells).subspan(first, last - first));
    }
}

} // namespace semrover
