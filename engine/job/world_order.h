// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"

namespace semrover {

// what a host looks at
struct WorldFocus {
    std::array<double, 3> position{};  // metres
    std::array<double, 3> direction{}; // of any length; only its part along the ground counts, zero: none
    double radius = 0;                 // metres, seen from above
};

// The tiles with a place within the radius, those that are wanted first in front: by the distance of their middle from
// the position, which counts up to three times as much behind it as ahead.
std::vector<TileIndex> tiles_in_order(const WorldFocus& focus, int32_t tile_cells, float voxel_size);

// metres from the position to the nearest place of a tile
double distance_to_tile(const WorldFocus& focus, const TileIndex& tile, int32_t tile_cells, float voxel_size);

// How coarse a tile at that distance is: 0 within `detail_distance`, 1 up to twice as far, 2 up to four times, and so
// on to kCoarsestDetail; always 0 where detail_distance is 0.
constexpr uint32_t kCoarsestDetail = 5;
uint32_t detail_of(double away, double detail_distance);

} // namespace semrover
