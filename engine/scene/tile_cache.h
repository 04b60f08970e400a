// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/tiles.h"

#include <memory>

namespace semrover {

// The source of a growing world's labels: a folder of tiles, or one grid that is cut into tiles in memory.
class TileSource {
  public:
    // tile_cells: for a .sgrid; a folder has its own. Errors: bad_input
    static Result<TileSource> open(const Path& path, int32_t tile_cells);

    float voxel_size() const { return voxel_size_; }
    int32_t tile_cells() const { return tile_cells_; }
    const std::map<std::string, std::string>& metadata() const { return metadata_; }
    bool has(const TileIndex& tile) const;
    std::vector<TileIndex> all_tiles() const;
    std::vector<TileIndex> tiles_in(const CellWindow& window) const;
    Result<VoxelGrid> read(const TileIndex& tile) const;

  private:
    std::optional<TileFolder> folder_;
    std::map<TileIndex, VoxelGrid> grids_;
    float voxel_size_ = 0;
    int32_t tile_cells_ = 0;
    std::map<std::string, std::string> metadata_;
};

// points that were made for some cells
struct GrownCells {
    std::vector<Cell> cells;
    std::vector<uint16_t> points; // [cells, n, 3]
    std::vector<uint8_t> colors;  // [cells, n, 3]
};

// The tiles around the place where a world grows. A tile is read from the output folder if it was written before, else
// from the source; it stays in memory while a window touches it.
class TileCache {
  public:
    TileCache(const TileSource& source, const Path& output, int points_per_voxel)
        : source_(source), output_(output), points_per_voxel_(points_per_voxel)
    {
    }

    // Returns the cells of a window, sorted, with arrays for points. Drops the tiles that it does not touch.
    Result<VoxelGrid> window(const CellWindow& window);
    // Sets points and generated = 1 for cells of tiles in memory, and writes these tiles. Doing it twice gives the same
    // files. note: call it only when `grown` is safe on the disk; else a killed run would not know of it.
    Status store(const GrownCells& grown);
    // Loads the tiles that hold these cells.
    Status bring(const std::vector<Cell>& cells);
    // The same without writing, for a dry run.
    Status mark(const GrownCells& grown);

    size_t cells_in_memory() const;

  private:
    Status bring(const TileIndex& tile);
    Status put(const GrownCells& grown, std::map<TileIndex, bool>& touched);

    const TileSource& source_;
    Path output_;
    int points_per_voxel_;
    std::map<TileIndex, VoxelGrid> tiles_;
};

} // namespace semrover
