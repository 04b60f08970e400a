// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

#include <map>

namespace semrover {

// A scene that is larger than memory: a folder with index.json and one .sgrid a tile. Tile (X, Y) is tile_X_Y.sgrid or,
// where its entry has a key, tile_X_Y.KEY.sgrid: so tiles of several worlds lie in one folder, and the index names
// those of one. A tile holds the voxels with floor(i / edge) = X and floor(j / edge) = Y, all k, at their places in the
// whole scene. Every tile has the index's voxel size; either all have points or none.
//   {"format": "semrover.tiles", "version": 1, "voxel_size": 0.6, "tile_cells": 64, "points_per_voxel": 20,
//    "has_points": true, "metadata": {...}, "tiles": [[X, Y, voxels], [X, Y, voxels, "0123456789abcdef"], ...]}
using TileIndex = std::array<int32_t, 2>;

// what an index says of a tile
struct TileEntry {
    uint64_t cells = 0;
    std::string key = {}; // names all that the tile was made of, in 16 hexadecimal digits; empty: none
    bool operator==(const TileEntry&) const = default;
};

// the edge of a tile in voxels for one in metres, rounded; bad_input for less than a voxel or more than 65536
Result<int32_t> tile_cells_of(double metres, float voxel_size);

TileIndex tile_of(const Cell& cell, int32_t edge);
std::string tile_name(const TileIndex& tile, std::string_view key = {}); // "tile_-1_3.sgrid"

// voxels low <= (i, j) <= high
struct CellWindow {
    std::array<int32_t, 2> low, high;
    bool holds(const Cell& cell) const
    {
        return cell[0] >= low[0] && cell[1] >= low[1] && cell[0] <= high[0] && cell[1] <= high[1];
    }
};

// the voxels of a tile and those up to `halo` voxels from it, along i and j
CellWindow tile_window(const TileIndex& tile, int32_t tile_cells, int32_t halo = 0);

// adds the voxels of `from`, which is sorted, that a window holds, with their labels only
void append_labels(VoxelGrid& to, const VoxelGrid& from, const CellWindow& window);

// the tiles of a map by index that a window touches, in order
template <typename T>
std::vector<TileIndex> tiles_in(const std::map<TileIndex, T>& tiles, const CellWindow& window, int32_t tile_cells)
{
    const TileIndex low = tile_of({window.low[0], window.low[1], 0}, tile_cells);
    const TileIndex high = tile_of({window.high[0], window.high[1], 0}, tile_cells);
    std::vector<TileIndex> found;
    for (auto entry = tiles.lower_bound(low); entry != tiles.end() && entry->first[0] <= high[0]; ++entry)
        if (entry->first[1] >= low[1] && entry->first[1] <= high[1])
            found.push_back(entry->first);
    return found;
}

class TileFolder {
  public:
    // reads and checks index.json, and that each tile is there; tiles are read when they are asked for. Errors:
    // bad_input
    static Result<TileFolder> open(const Path& folder);
    static bool is_one(const Path& path); // a folder with an index.json

    const Path& path() const { return path_; }
    float voxel_size() const { return voxel_size_; }
    int32_t tile_cells() const { return tile_cells_; }
    int points_per_voxel() const { return points_per_voxel_; }
    bool has_points() const { return has_points_; }
    const std::map<std::string, std::string>& metadata() const { return metadata_; }
    const std::map<TileIndex, TileEntry>& tiles() const { return tiles_; }
    uint64_t cell_count() const;
    std::vector<TileIndex> tiles_in(const CellWindow& window) const; // in order

    // one tile, checked against the index
    Result<VoxelGrid> read(const TileIndex& tile) const;
    Result<VoxelGrid> read_all() const;

  private:
    Path path_;
    float voxel_size_ = 0;
    int32_t tile_cells_ = 0;
    int points_per_voxel_ = 0;
    bool has_points_ = false;
    std::map<std::string, std::string> metadata_;
    std::map<TileIndex, TileEntry> tiles_;
};

// The fields of index.json beside the list of tiles. It is written last, so a folder without it is not whole.
struct TileFolderInfo {
    float voxel_size = 0;
    int32_t tile_cells = 0;
    int points_per_voxel = 0;
    bool has_points = false;
    std::map<std::string, std::string> metadata;
};
Status write_tile_index(const Path& folder, const TileFolderInfo& info, const std::map<TileIndex, TileEntry>& tiles);

// cuts a grid into tiles and writes the folder, which must not exist or be empty
Status write_tiles(const Path& folder, const VoxelGrid& grid, int32_t tile_cells);
std::map<TileIndex, VoxelGrid> cut_tiles(const VoxelGrid& grid, int32_t tile_cells);

// cells of `part` behind those of `grid`, whose voxel size and points fit; sort_cells puts them in order
void append_cells(VoxelGrid& grid, const VoxelGrid& part);

// Reads a .sgrid, or all tiles of a folder.
Result<VoxelGrid> read_grid_or_tiles(const Path& path);

std::array<TileIndex, 8> tiles_around(const TileIndex& tile); // those beside it, in order

} // namespace semrover
