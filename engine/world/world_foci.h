// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"

#include <algorithm>
#include <map>

namespace semrover {

using GroundPoint = std::array<double, 2>; // metres, seen from above

// what a camera looks at
struct WorldFocus {
    std::array<double, 3> position{};  // metres
    std::array<double, 3> direction{}; // of any length; only its part along the ground counts, zero: none
    double radius = 0;                 // metres, seen from above
};
using WorldFoci = std::vector<WorldFocus>;
constexpr size_t kMostFoci = 64;

// usage for numbers that are not finite, a radius that is not 0..2000 m, a place beyond 2^19 voxels, and others than 1
// to kMostFoci
Status check_foci(const WorldFoci& foci, float voxel_size);

// so little moved and turned that what is wanted stays the same: by less than an eighth of a tile, and some ten degrees
bool is_nearly(const WorldFoci& a, const WorldFoci& b, double edge);

// metres from a point to the nearest place of a tile; of the nearest focus, 0 where there is none
double distance_to_tile(const GroundPoint& point, const TileIndex& tile, double edge);
double distance_to_tile(const WorldFocus& focus, const TileIndex& tile, double edge);
double distance_to_tile(const WorldFoci& foci, const TileIndex& tile, double edge);

// of all foci; false where there is none
bool out_of_reach(const WorldFoci& foci, const TileIndex& tile, double edge);

// what foci reach, with a margin in metres around it
CellWindow window_around(const WorldFoci& foci, double margin, float voxel_size);

// those of a map's tiles that are picked, the nearest to a focus first
template <typename T, typename Picks>
std::vector<TileIndex> nearest_first(const std::map<TileIndex, T>& tiles, const WorldFoci& foci, double edge,
                                     Picks picks)
{
    std::vector<std::pair<double, TileIndex>> picked;
    for (const auto& [index, there] : tiles)
        if (picks(index))
            picked.emplace_back(distance_to_tile(foci, index, edge), index);
    std::ranges::sort(picked);
    std::vector<TileIndex> indices;
    for (const auto& [away, index] : picked)
        indices.push_back(index);
    return indices;
}

} // namespace semrover
