// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/world_labels.h"

#include "engine/scene/palette.h"

#include <algorithm>
#include <deque>

namespace semrover {

namespace {

constexpr size_t kTilesKept = 9; // of a folder: a place and what is around it

VoxelGrid empty_grid(float voxel_size)
{
    VoxelGrid grid;
    grid.voxel_size = voxel_size;
    return grid;
}

class GridLabels : public WorldLabels {
  public:
    explicit GridLabels(VoxelGrid grid) : grid_(std::move(grid)) { sort_cells(grid_); }

    float voxel_size() const override { return grid_.voxel_size; }
    Result<VoxelGrid> read(const CellWindow& window) override
    {
        VoxelGrid out = empty_grid(grid_.voxel_size);
        append_labels(out, grid_, window);
        return out;
    }

  private:
    VoxelGrid grid_;
};

class FolderLabels : public WorldLabels {
  public:
    explicit FolderLabels(TileFolder folder) : folder_(std::move(folder)) {}

    float voxel_size() const override { return folder_.voxel_size(); }
    Result<VoxelGrid> read(const CellWindow& window) override
    {
        VoxelGrid out = empty_grid(folder_.voxel_size());
        for (const TileIndex& index : folder_.tiles_in(window)) {
            SR_TRY(const VoxelGrid* tile, tile_at(index));
            append_labels(out, *tile, window);
        }
        sort_cells(out);
        return out;
    }

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
        SR_ASSERT(grid.cells.size() == grid.labels.size(), "{} cells, {} labels", grid.cells.size(),
                  grid.labels.size());
        grid.points.clear();
        grid.colors.clear();
        grid.generated.clear();
        sort_cells(grid);
        for (size_t c = 0; c < grid.cells.size(); ++c) {
            const Cell& cell = grid.cells[c];
            if (!window.holds(cell) || grid.labels[c] >= kClassCount || (c && grid.cells[c - 1] == cell))
                return fail(ErrorCode::bad_input, "labels of a world: cell ({}, {}, {}) with label {} {}", cell[0],
                            cell[1], cell[2], grid.labels[c],
                            !window.holds(cell)             ? "is not in the window that was asked for"
                            : grid.labels[c] >= kClassCount ? "of no class"
                                                            : "is given twice");
        }
        return grid;
    }

  private:
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
