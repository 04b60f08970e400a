// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/tile_cache.h"

#include "runtime/base/quote.h"

#include <algorithm>

namespace semrover {

Result<TileSource> TileSource::open(const Path& path, int32_t tile_cells)
{
    TileSource s;
    if (std::filesystem::is_directory(path)) {
        SR_TRY(TileFolder folder, TileFolder::open(path));
        s.voxel_size_ = folder.voxel_size();
        s.tile_cells_ = folder.tile_cells();
        s.metadata_ = folder.metadata();
        s.folder_ = std::move(folder);
        return s;
    }
    SR_TRY(const VoxelGrid grid, read_grid(path));
    s.voxel_size_ = grid.voxel_size;
    s.tile_cells_ = tile_cells;
    s.metadata_ = grid.metadata;
    s.grids_ = cut_tiles(grid, tile_cells);
    return s;
}

bool TileSource::has(const TileIndex& tile) const
{
    return folder_ ? folder_->tiles().contains(tile) : grids_.contains(tile);
}

std::vector<TileIndex> TileSource::all_tiles() const
{
    std::vector<TileIndex> tiles;
    const auto collect = [&](const auto& map) {
        for (const auto& [tile, rest] : map)
            tiles.push_back(tile);
    };
    folder_ ? collect(folder_->tiles()) : collect(grids_);
    return tiles;
}

std::vector<TileIndex> TileSource::tiles_in(const CellWindow& window) const
{
    return folder_ ? folder_->tiles_in(window) : semrover::tiles_in(grids_, window, tile_cells_);
}

Result<VoxelGrid> TileSource::read(const TileIndex& tile) const
{
    if (folder_)
        return folder_->read(tile);
    return grids_.at(tile);
}

Status TileCache::bring(const TileIndex& tile)
{
    if (tiles_.contains(tile))
        return {};
    const Path written = output_ / tile_name(tile);
    VoxelGrid grid;
    if (std::filesystem::exists(written)) {
        SR_TRY(grid, read_grid(written));
    } else {
        SR_TRY(grid, source_.read(tile));
    }
    if (grid.has_points() && grid.points_per_voxel != points_per_voxel_)
        return fail(ErrorCode::bad_input, "tile {} has {} points a cell, the model makes {}", tile_name(tile),
                    grid.points_per_voxel, points_per_voxel_);
    if (!grid.has_points()) {
        const size_t values = grid.cells.size() * size_t(points_per_voxel_) * 3;
        grid.points_per_voxel = points_per_voxel_;
        grid.points.assign(values, 0);
        grid.colors.assign(values, 0);
        grid.generated.assign(grid.cells.size(), 0);
    }
    tiles_.emplace(tile, std::move(grid));
    return {};
}

Status TileCache::bring(const std::vector<Cell>& cells)
{
    for (const Cell& cell : cells) {
        const TileIndex tile = tile_of(cell, source_.tile_cells());
        if (!source_.has(tile))
            return fail(ErrorCode::bad_input, "saved cell ({}, {}, {}) is not in the scaffold", cell[0], cell[1],
                        cell[2]);
        SR_CHECK(bring(tile));
    }
    return {};
}

Result<VoxelGrid> TileCache::window(const CellWindow& window)
{
    const std::vector<TileIndex> needed = source_.tiles_in(window);
    std::erase_if(tiles_, [&](const auto& entry) { return !std::ranges::binary_search(needed, entry.first); });
    VoxelGrid out;
    out.voxel_size = source_.voxel_size();
    out.points_per_voxel = points_per_voxel_;
    for (const TileIndex& index : needed) {
        SR_CHECK(bring(index));
        const VoxelGrid& tile = tiles_.at(index);
        for (size_t c = 0; c < tile.cells.size(); ++c)
            if (window.holds(tile.cells[c]))
                append_cell(out, tile, c);
    }
    sort_cells(out);
    return out;
}

Status TileCache::put(const GrownCells& grown, std::map<TileIndex, bool>& touched)
{
    const size_t width = size_t(points_per_voxel_) * 3;
    SR_ASSERT(grown.points.size() == grown.cells.size() * width && grown.colors.size() == grown.points.size(),
              "{} cells, {} points", grown.cells.size(), grown.points.size());
    for (size_t i = 0; i < grown.cells.size(); ++i) {
        const TileIndex index = tile_of(grown.cells[i], source_.tile_cells());
        const auto entry = tiles_.find(index);
        SR_ASSERT(entry != tiles_.end(), "tile ({}, {}) is not in memory", index[0], index[1]);
        VoxelGrid& tile = entry->second;
        const auto c = find_cell(tile, grown.cells[i]);
        if (!c)
            return fail(ErrorCode::bad_input, "saved cell ({}, {}, {}) is not in tile {}", grown.cells[i][0],
                        grown.cells[i][1], grown.cells[i][2], tile_name(index));
        std::copy_n(&grown.points[i * width], width, &tile.points[*c * width]);
        std::copy_n(&grown.colors[i * width], width, &tile.colors[*c * width]);
        tile.generated[*c] = 1;
        touched[index] = true;
    }
    return {};
}

Status TileCache::store(const GrownCells& grown)
{
    std::map<TileIndex, bool> touched;
    SR_CHECK(put(grown, touched));
    for (const auto& [index, yes] : touched)
        SR_CHECK(write_grid(output_ / tile_name(index), tiles_.at(index)));
    return {};
}

Status TileCache::mark(const GrownCells& grown)
{
    std::map<TileIndex, bool> touched;
    return put(grown, touched);
}

size_t TileCache::cells_in_memory() const
{
    size_t cells = 0;
    for (const auto& [index, tile] : tiles_)
        cells += tile.cells.size();
    return cells;
}

} // namespace semrover
