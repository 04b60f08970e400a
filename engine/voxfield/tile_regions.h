// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"
#include "engine/voxfield/regions.h"

namespace semrover {

// The order of tiles (docs/method.md §4.4), in which the points of a place depend on the labels near it and not on the
// way that generation came. The plane is cut into square tiles, as TileFolder's. A tile sees the finished voxels of
// tiles of lower colours.

constexpr int kTileColours = 3;

// how many of the two indices are odd: tiles of one colour touch at corners at most, and never see each other
int tile_colour(const TileIndex& tile);

// usage for strategy paper, and for tiles that are narrower than the halo
Status check_tile_options(const RegionOptions& options);

// Tiles that see `tile`: those of higher colours among its eight neighbours. What changes in a tile changes their
// points, too, and nobody else's.
std::vector<TileIndex> tiles_that_see(const TileIndex& tile);
// Tiles that `tile` sees: those of lower colours among its neighbours, lower colours first. All that these see are
// neighbours of `tile`, too.
std::vector<TileIndex> tiles_seen_by(const TileIndex& tile);

// Covers each tile with regions of its own (extract_regions), colour after colour: from its lowest voxel or, where
// voxels within the halo are known, from those. Those are the voxels that `known` says, and those of tiles of lower
// colours. cells [n]: sorted. options: with tile_cells and halo_cells. Errors: as extract_regions and
// check_tile_options
Result<Regions> extract_tile_regions(std::span<const Cell> cells, const RegionOptions& options,
                                     std::span<const uint8_t> known = {});

} // namespace semrover
