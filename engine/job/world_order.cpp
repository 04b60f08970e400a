// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/world_order.h"

#include "engine/scene/cell_reach.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

double weight(const WorldFocus& focus, const TileIndex& tile, double edge)
{
    const double x = (tile[0] + 0.5) * edge - focus.position[0], y = (tile[1] + 0.5) * edge - focus.position[1];
    const double away = std::hypot(x, y), length = std::hypot(focus.direction[0], focus.direction[1]);
    if (away == 0 || !(length > 0))
        return away;
    return away * (2 - (x * focus.direction[0] + y * focus.direction[1]) / (away * length));
}

} // namespace

double distance_to_tile(const WorldFocus& focus, const TileIndex& tile, int32_t tile_cells, float voxel_size)
{
    const double edge = tile_cells * decimal_voxel_size(voxel_size);
    double outside[2];
    for (size_t a = 0; a < 2; ++a)
        outside[a] = std::max({0.0, tile[a] * edge - focus.position[a], focus.position[a] - (tile[a] + 1) * edge});
    return std::hypot(outside[0], outside[1]);
}

uint32_t detail_of(double away, double detail_distance)
{
    uint32_t detail = 0;
    for (double reach = detail_distance; reach > 0 && away > reach && detail < kCoarsestDetail; reach *= 2)
        ++detail;
    return detail;
}

std::vector<TileIndex> tiles_in_order(const WorldFocus& focus, int32_t tile_cells, float voxel_size)
{
    const double edge = tile_cells * decimal_voxel_size(voxel_size);
    const auto index = [edge](double metres) { return int32_t(std::floor(metres / edge)); };
    std::vector<std::pair<double, TileIndex>> tiles;
    for (int32_t x = index(focus.position[0] - focus.radius); x <= index(focus.position[0] + focus.radius); ++x)
        for (int32_t y = index(focus.position[1] - focus.radius); y <= index(focus.position[1] + focus.radius); ++y)
            if (distance_to_tile(focus, {x, y}, tile_cells, voxel_size) <= focus.radius)
                tiles.emplace_back(weight(focus, {x, y}, edge), TileIndex{x, y});
    std::ranges::sort(tiles);
    std::vector<TileIndex> order;
    for (const auto& [away, tile] : tiles)
        order.push_back(tile);
    return order;
}

} // namespace semrover
