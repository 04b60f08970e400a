// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_labels.h"

#include "engine/scene/palette.h"

#include <algorithm>
#include <deque>
#include <set>

namespace semrover {

namespace {

constexpr size_t kTilesKept = 9; // of a folder: a place and what is around it

VoxelGrid empty_grid(float voxel_size, int points_per_voxel = 0)
{
    VoxelGrid grid;
    grid.voxel_size = voxel_size;
    grid.points_per_voxel = points_per_voxel;
    return grid;
}

// adds the voxels of `from`, which is sorted, that a window holds
void append_window(VoxelGrid& to, const VoxelGrid& from, const CellWindow& window)
{
    if (!from.has_points())
        return append_labels(to, from, window);
    const auto begin = std::ranges::lower_bound(from.cells, Cell{window.low[0], INT32_MIN, INT32_MIN});
    for (size_t c = size_t(begin - from.cells.begin()); c < from.cells.size() && from.cells[c][0] <= window.high[0];
         ++c)
        if (window.holds(from.cells[c]))
            append_cell(to, from, c);
}

class GridLabels : public WorldLabels {
  public:
    explicit GridLabels(VoxelGrid grid) : grid_(std::move(grid)) { sort_cells(grid_); }

    float voxel_size() const override { return grid_.voxel_size; }
    int points_per_voxel() const override { return grid_.has_points() ? grid_.points_per_voxel : 0; }
    Result<VoxelGrid> read(const CellWindow& window) override
    {
        VoxelGrid out = empty_grid(grid_.voxel_size, points_per_voxel());
        append_window(out, grid_, window);
        return out;
    }
    Result<std::vector<TileIndex>> tiles(int32_t tile_cells) const override
    {
        std::set<TileIndex> tiles;
        for (const Cell& cell : grid_.cells)
            tiles.insert(tile_of(cell, tile_cells));
        return std::vector<TileIndex>(tiles.begin(), tiles.end());
    }
    Result<VoxelGrid> take() override { return std::move(grid_); }

  private:
    VoxelGrid grid_;
};

class FolderLabels : public WorldLabels {
  public:
    explicit FolderLabels(TileFolder folder) : folder_(std::move(folder)) {}

    float voxel_size() const override { return folder_.voxel_size(); }
    int points_per_voxel() const override { return folder_.has_points() ? folder_.points_per_voxel() : 0; }
    Result<VoxelGrid> read(const CellWindow& window) override
    {
        VoxelGrid out = empty_grid(folder_.voxel_size(), points_per_voxel());
        for (const TileIndex& index : folder_.tiles_in(window)) {
            SR_TRY(const VoxelGrid* tile, tile_at(index));
            append_window(out, *tile, window);
        }
        sort_cells(out);
        return out;
    }
    Result<std::vector<TileIndex>> tiles(int32_t tile_cells) const override
    {
        std::set<TileIndex> tiles;
        for (const auto& [index, entry] : folder_.tiles()) {
            const CellWindow held = tile_window(index, folder_.tile_cells());
            const TileIndex low = tile_of({held.low[0], held.low[1], 0}, tile_cells);
            const TileIndex high = tile_of({held.high[0], held.high[1], 0}, tile_cells);
            for (int32_t x = low[0]; x <= high[0]; ++x)
                for (int32_t y = low[1]; y <= high[1]; ++y)
                    tiles.insert({x, y});
        }
        return std::vector<TileIndex>(tiles.begin(), tiles.end());
    }
    Result<VoxelGrid> take() override { return folder_.read_all(); }

  private:
    Result<const VoxelGrid*> tile_at(const TileIndex& index)
    {
        const auto kept = std::ranges::find(kept_, index, &Kept::first);
        if (kept != kept_.end())
            return &kept->second;
        SR_TRY(VoxelGrid tile, folder_.read(index));
        if (kept_.size() == kTilesKept)
            kept_.pop_front();
        kept_.emplace_back(index, std::move(tile));
        return &kept_.back().second;
    }

    using Kept = std::pair<TileIndex, VoxelGrid>;
    TileFolder folder_;
    std::deque<Kept> kept_;
};

class CallbackLabels : public WorldLabels {
  public:
    CallbackLabels(float voxel_size, LabelCallback callback) : voxel_size_(voxel_size), callback_(std::move(callback))
    {
    }

    float voxel_size() const override { return voxel_size_; }
    Result<VoxelGrid> read(const CellWindow& window) override
    {
        VoxelGrid grid = empty_grid(voxel_size_);
        SR_CHECK(callback_(window, grid));
        SR_ASSERT(grid.cells.size() == grid.labels.size(), "{} voxels, {} labels", grid.cells.size(),
                  grid.labels.size());
        grid.points.clear();
        grid.colors.clear();
        grid.generated.clear();
        sort_cells(grid);
        for (size_t c = 0; c < grid.cells.size(); ++c) {
            const Cell& cell = grid.cells[c];
            if (!window.holds(cell) || grid.labels[c] >= kClassCount || (c && grid.cells[c - 1] == cell))
                return fail(ErrorCode::bad_input, "labels of a world: voxel ({}, {}, {}) with label {} {}", cell[0],
                            cell[1], cell[2], grid.labels[c],
                            !window.holds(cell)             ? "is not in the window that was asked for"
                            : grid.labels[c] >= kClassCount ? "of no class"
                                                            : "is given twice");
        }
        return grid;
    }

    Result<std::vector<TileIndex>> tiles(int32_t) const override { return without_end(); }
    Result<VoxelGrid> take() override { return without_end(); }

  private:
    static tl::unexpected<Error> without_end()
    {
        return fail(ErrorCode::usage, "labels of a callback have no end: not all of them can be generated");
    }

    float voxel_size_;
    LabelCallback callback_;
};

} // namespace

std::unique_ptr<WorldLabels> labels_of_grid(VoxelGrid grid)
{
    return std::make_unique<GridLabels>(std::move(grid));
}

Result<std::unique_ptr<WorldLabels>> labels_of_folder(const Path& folder)
{
    SR_TRY(TileFolder tiles, TileFolder::open(folder));
    return std::make_unique<FolderLabels>(std::move(tiles));
}

std::unique_ptr<WorldLabels> labels_of_callback(float voxel_size, LabelCallback callback)
{
    return std::make_unique<CallbackLabels>(voxel_size, std::move(callback));
}

} // namespace semrover
