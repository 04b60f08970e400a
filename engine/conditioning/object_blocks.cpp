// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/conditioning/object_blocks.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/scene/cell_reach.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace semrover {

namespace {

constexpr double kBlockMetres = 38.4;

} // namespace

int32_t object_block_cells(float voxel_size)
{
    return std::max(1, int32_t(std::lround(kBlockMetres / decimal_voxel_size(voxel_size))));
}

CellWindow labels_of_block(const TileIndex& block, int32_t edge)
{
    return tile_window(block, edge, edge / 2);
}

std::vector<TileIndex> blocks_that_reach(const CellWindow& window, int32_t edge)
{
    const TileIndex low = tile_of({window.low[0], window.low[1], 0}, edge);
    const TileIndex high = tile_of({window.high[0], window.high[1], 0}, edge);
    std::vector<TileIndex> blocks;
    for (int32_t x = low[0] - 1; x <= high[0] + 1; ++x)
        for (int32_t y = low[1] - 1; y <= high[1] + 1; ++y)
            blocks.push_back({x, y});
    return blocks;
}

Result<std::vector<SceneObject>> guess_block(const VoxelGrid& labels, const TileIndex& block, const UsualObjects& usual,
                                             uint64_t seed)
{
    const int32_t edge = object_block_cells(labels.voxel_size);
    VoxelGrid around;
    around.voxel_size = labels.voxel_size;
    append_labels(around, labels, labels_of_block(block, edge));
    std::vector<SceneObject> kept;
    if (around.cells.empty())
        return kept;
    SR_TRY(const std::vector<SceneObject> found, guess_objects(around, usual, seed));
    const double reach = edge * decimal_voxel_size(labels.voxel_size) - kObjectReach;
    for (SceneObject o : found) {
        if (tile_of(cell_at(o.center, labels.voxel_size), edge) != block ||
            std::hypot(o.size[0], o.size[1]) > 2 * reach)
            continue;
        o.id = uint32_t(kept.size());
        kept.push_back(o);
    }
    return kept;
}

Result<std::vector<SceneObject>> guess_blocks(const VoxelGrid& grid, const UsualObjects& usual, uint64_t seed)
{
    const int32_t edge = object_block_cells(grid.voxel_size);
    std::set<TileIndex> blocks;
    for (const Cell& cell : grid.cells)
        for (const TileIndex& block : blocks_that_reach({{cell[0], cell[1]}, {cell[0], cell[1]}}, edge))
            blocks.insert(block);
    std::vector<SceneObject> objects;
    for (const TileIndex& block : blocks) {
        SR_TRY(const std::vector<SceneObject> found, guess_block(grid, block, usual, seed));
        for (SceneObject o : found) {
            o.id = uint32_t(objects.size());
            if (objects.size() < kMaxObjects)
                objects.push_back(o);
        }
    }
    return objects;
}

} // namespace semrover
