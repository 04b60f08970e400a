// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_tiles.h"

#include "engine/conditioning/voxel_conditions.h"
#include "engine/job/version.h"
#include "engine/voxfield/sub_grid.h"
#include "runtime/base/hash.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kMostEmpty = 1 << 20; // places that are remembered

// voxels that have points already
std::vector<uint8_t> known_of(const VoxelGrid& cells)
{
    return std::ranges::count(cells.generated, 0) == int64_t(cells.generated.size()) ? std::vector<uint8_t>()
                                                                                     : cells.generated;
}

// those of its voxels that have points
VoxelGrid with_points(const VoxelGrid& cells)
{
    VoxelGrid out;
    out.voxel_size = cells.voxel_size;
    out.points_per_voxel = cells.points_per_voxel;
    for (size_t c = 0; c < cells.generated.size(); ++c)
        if (cells.generated[c])
            append_cell(out, cells, c);
    return out;
}

std::vector<TileIndex> beside(const TileIndex& tile)
{
    std::vector<TileIndex> tiles = tiles_seen_by(tile);
    for (int32_t x = -1; x <= 1; ++x)
        for (int32_t y = -1; y <= 1; ++y)
            if (const TileIndex other{tile[0] + x, tile[1] + y}; other != tile && !std::ranges::count(tiles, other))
                tiles.push_back(other);
    return tiles;
}

} // namespace

WorldTiles::WorldTiles(const GenerationSettings& settings, WorldLabels& labels, WorldObjects objects,
                       std::unique_ptr<TileStore> store, uint64_t base)
    : settings_(settings), labels_(labels), objects_(std::move(objects)), store_(std::move(store)), base_(base)
{
}

Result<WorldTile*> WorldTiles::bring(const TileIndex& tile)
{
    if (const auto there = tiles_.find(tile); there != tiles_.end())
        return &there->second;
    if (empty_.contains(tile))
        return nullptr;
    SR_TRY(const VoxelGrid labels, labels_.read(tile_window(tile, edge())));
    const auto edits = edits_.find(tile);
    WorldTile made{.cells = edits == edits_.end() ? labels : with_edits(labels, edits->second)};
    if (settings_.model.folder.empty())
        made.cells = with_points(made.cells);
    if (made.cells.cells.empty()) {
        if (empty_.size() == kMostEmpty)
            empty_.clear();
        empty_.insert(tile);
        return nullptr;
    }
    made.known = known_of(made.cells);
    made.finished = made.fresh = !made.known.empty() && !std::ranges::count(made.known, 0);
    WorldTile& there = tiles_.emplace(tile, std::move(made)).first->second;
    count(there);
    return &there;
}

const WorldTile* WorldTiles::find(const TileIndex& tile) const
{
    const auto there = tiles_.find(tile);
    return there == tiles_.end() ? nullptr : &there->second;
}

void WorldTiles::count(WorldTile& tile)
{
    const VoxelGrid& c = tile.cells;
    bytes_ -= tile.bytes;
    tile.bytes = sizeof(tile) + c.cells.size() * sizeof(Cell) + c.labels.size() + c.points.size() * 2 +
                 c.colors.size() + c.generated.size() + tile.known.size();
    bytes_ += tile.bytes;
}

uint64_t WorldTiles::bytes_with_points(const WorldTile& tile) const
{
    const size_t n = settings_.model.config.points_per_voxel;
    return sizeof(tile) + tile.known.size() + tile.cells.cells.size() * (sizeof(Cell) + 2 + n * 9);
}

void WorldTiles::drop(const TileIndex& tile)
{
    const auto there = tiles_.find(tile);
    if (there == tiles_.end())
        return;
    bytes_ -= there->second.bytes;
    tiles_.erase(there);
}

// of the tile's voxels and of the model's conditioning on them, of the tiles that it sees, and of the points around it
// that the source has
Result<uint64_t> WorldTiles::key_of(const TileIndex& index)
{
    Hash hash;
    const auto add = [&hash](const auto& values) { hash.add(std::as_bytes(std::span(values))); };
    add(std::array{base_});
    add(index);
    SR_TRY(WorldTile * tile, bring(index));
    if (!tile)
        return hash.value();
    if (tile->key)
        return *tile->key;
    add(tile->cells.cells);
    add(tile->cells.labels);
    SR_TRY(const std::vector<SceneObject> objects, objects_near({&index, 1}));
    SR_TRY(const VoxelConditions conditions, VoxelConditions::create(settings_.model.config, tile->cells, objects));
    std::vector<float> row(conditions.width());
    for (uint32_t c = 0; c < tile->cells.cells.size() && !conditions.empty(); ++c) {
        conditions.row(c, tile->cells.cells[c], row);
        add(row);
    }
    for (const TileIndex& seen : tiles_seen_by(index)) {
        SR_TRY(const uint64_t key, key_of(seen));
        add(std::array{key});
    }
    if (labels_.points_per_voxel()) {
        VoxelGrid known;
        SR_CHECK(add_known(known, index, {&index, 1}, false));
        for (const TileIndex& other : beside(index))
            SR_CHECK(add_known(known, other, {&index, 1}, false));
        add(known.cells);
        add(known.points);
        add(known.colors);
    }
    tile->key = hash.value(); // note: what a map holds stays where it is while others are brought
    return *tile->key;
}

// Adds what targets know of another tile: all voxels of one that they see, those with points in the source of others.
Status WorldTiles::add_known(VoxelGrid& part, const TileIndex& index, std::span<const TileIndex> targets, bool seen)
{
    SR_TRY(const WorldTile* tile, bring(index));
    if (!tile)
        return {};
    SR_ASSERT(!seen || tile->finished, "tile ({}, {}) is seen before it is finished", index[0], index[1]);
    for (size_t c = 0; c < tile->cells.cells.size(); ++c) {
        const Cell& cell = tile->cells.cells[c];
        if (!seen && (tile->known.empty() || !tile->known[c]))
            continue;
        if (std::ranges::any_of(targets, [&](const TileIndex& target) {
                return tile_window(target, edge(), settings_.regions.halo_cells).holds(cell);
            }))
            append_cell(part, tile->cells, c);
    }
    return {};
}

Result<bool> WorldTiles::load(const TileIndex& index)
{
    if (!store_)
        return false;
    SR_TRY(WorldTile * tile, bring(index));
    if (!tile)
        return false;
    SR_TRY(const uint64_t key, key_of(index));
    const std::optional<VoxelGrid> stored = store_->read(index, key);
    const bool same = stored && stored->cells == tile->cells.cells && stored->labels == tile->cells.labels &&
                      stored->points_per_voxel == int(settings_.model.config.points_per_voxel);
    if (!same || !stored->has_points() || std::ranges::count(stored->generated, 0))
        return false;
    tile->cells.points_per_voxel = stored->points_per_voxel;
    tile->cells.points = stored->points;
    tile->cells.colors = stored->colors;
    tile->cells.generated = stored->generated;
    tile->finished = tile->stored = true;
    count(*tile);
    return true;
}

Result<VoxelGrid> WorldTiles::cut(std::span<const TileIndex> targets)
{
    VoxelGrid part;
    part.voxel_size = labels_.voxel_size();
    part.points_per_voxel = int(settings_.model.config.points_per_voxel);
    std::map<TileIndex, bool> around; // true: seen
    for (const TileIndex& target : targets) {
        SR_ASSERT(tile_colour(target) == tile_colour(targets[0]), "tiles of two colours at a time");
        SR_TRY(WorldTile * tile, bring(target));
        make_room_for_points(tile->cells, part.points_per_voxel);
        count(*tile);
        append_cells(part, tile->cells);
        if (labels_.points_per_voxel())
            for (const TileIndex& other : beside(target))
                around.emplace(other, false);
        for (const TileIndex& other : tiles_seen_by(target))
            around[other] = true;
    }
    for (const TileIndex& target : targets)
        around.erase(target);
    for (const auto& [other, seen] : around)
        SR_CHECK(add_known(part, other, targets, seen));
    sort_cells(part);
    return part;
}

Result<std::vector<SceneObject>> WorldTiles::objects_near(std::span<const TileIndex> tiles)
{
    CellWindow window = tile_window(tiles[0], edge(), settings_.regions.halo_cells);
    for (const TileIndex& tile : tiles) {
        const CellWindow one = tile_window(tile, edge(), settings_.regions.halo_cells);
        for (size_t a = 0; a < 2; ++a) {
            window.low[a] = std::min(window.low[a], one.low[a]);
            window.high[a] = std::max(window.high[a], one.high[a]);
        }
    }
    return objects_.near(labels_, window);
}

Status WorldTiles::finish(std::span<const TileIndex> targets, const VoxelGrid& part)
{
    const size_t width = size_t(part.points_per_voxel) * 3;
    for (const TileIndex& target : targets) {
        WorldTile& tile = tiles_.at(target);
        for (size_t c = 0; c < tile.cells.cells.size(); ++c) {
            const auto found = find_cell(part, tile.cells.cells[c]);
            SR_ASSERT(found && part.generated[*found], "a voxel of a finished tile has no points");
            std::copy_n(&part.points[*found * width], width, &tile.cells.points[c * width]);
            std::copy_n(&part.colors[*found * width], width, &tile.cells.colors[c * width]);
            tile.cells.generated[c] = 1;
        }
        tile.finished = true;
    }
    if (!store_)
        return {};
    for (const TileIndex& target : targets)
        SR_CHECK(write(target, tiles_.at(target)));
    return {};
}

Status WorldTiles::keep(const TileIndex& index)
{
    WorldTile& tile = tiles_.at(index);
    return store_ && !tile.stored ? write(index, tile) : Status();
}

Status WorldTiles::write(const TileIndex& index, WorldTile& from)
{
    SR_TRY(const uint64_t key, key_of(index));
    VoxelGrid file = from.cells;
    file.metadata = {{"tool", kProgram}};
    SR_CHECK(store_->write(index, key, std::move(file)));
    from.stored = store_->writable().has_value();
    return {};
}

std::vector<TileIndex> WorldTiles::edit(const LabelEdits& edits)
{
    std::set<TileIndex> changed;
    for (const auto& [cell, label] : edits) {
        const TileIndex tile = tile_of(cell, edge());
        edits_[tile][cell] = label;
        changed.insert(tile);
    }
    std::set<TileIndex> spoiled = changed;
    for (const TileIndex& tile : changed)
        for (const TileIndex& other : labels_.points_per_voxel() ? beside(tile) : tiles_that_see(tile))
            spoiled.insert(other);
    for (const TileIndex& tile : spoiled) {
        drop(tile); // its labels are read again
        empty_.erase(tile);
        if (store_)
            store_->forget(tile);
    }
    return std::vector<TileIndex>(spoiled.begin(), spoiled.end());
}

} // namespace semrover
