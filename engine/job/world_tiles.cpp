// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/world_tiles.h"

#include "engine/job/version.h"
#include "engine/voxfield/cell_conditions.h"
#include "engine/voxfield/sub_grid.h"
#include "runtime/base/hash.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr size_t kFilesWaiting = 16; // for the disk

} // namespace

uint64_t WorldTile::bytes() const
{
    return sizeof(*this) + cells.cells.size() * sizeof(Cell) + cells.labels.size() + cells.points.size() * 2 +
           cells.colors.size() + cells.generated.size();
}

WorldTiles::WorldTiles(const GenerationSettings& settings, WorldLabels& labels, WorldObjects objects, const Path& cache,
                       uint64_t base)
    : settings_(settings), labels_(labels), objects_(std::move(objects)), cache_(cache), base_(base)
{
}

Result<std::unique_ptr<WorldTiles>> WorldTiles::create(const GenerationSettings& settings, WorldLabels& labels,
                                                       WorldObjects objects, const Path& cache, uint64_t base)
{
    std::unique_ptr<WorldTiles> t(new WorldTiles(settings, labels, std::move(objects), cache, base));
    if (cache.empty())
        return t;
    SR_CHECK(make_folder(cache));
    SR_CHECK(AtomicFile::create(cache / "writable").map([](const AtomicFile&) {}));
    t->files_ = std::make_unique<FileQueue>(kFilesWaiting);
    return t;
}

Result<WorldTile*> WorldTiles::bring(const TileIndex& tile)
{
    if (const auto there = tiles_.find(tile); there != tiles_.end())
        return &there->second;
    SR_TRY(const VoxelGrid labels, labels_.read(tile_window(tile, edge())));
    const auto edits = edits_.find(tile);
    WorldTile made{.cells = edits == edits_.end() ? labels : with_edits(labels, edits->second)};
    made.finished = made.cells.cells.empty();
    return &tiles_.emplace(tile, std::move(made)).first->second;
}

uint64_t WorldTiles::bytes() const
{
    uint64_t bytes = 0;
    for (const auto& [index, tile] : tiles_)
        bytes += tile.bytes();
    return bytes;
}

uint64_t WorldTiles::bytes_with_points(const WorldTile& tile) const
{
    const size_t n = settings_.model.config.points_per_voxel;
    return sizeof(tile) + tile.cells.cells.size() * (sizeof(Cell) + 2 + n * 9);
}

// of the tile's labels, of what the model is told of them, and of the tiles that it sees
Result<uint64_t> WorldTiles::key_of(const TileIndex& index)
{
    SR_TRY(WorldTile * tile, bring(index));
    if (tile->key)
        return *tile->key;
    Hash hash;
    const auto add = [&hash](const auto& values) { hash.add(std::as_bytes(std::span(values))); };
    add(std::array{base_});
    add(index);
    add(tile->cells.cells);
    add(tile->cells.labels);
    if (!tile->cells.cells.empty()) {
        SR_TRY(const std::vector<SceneObject> objects, objects_near({&index, 1}));
        SR_TRY(const CellConditions told, CellConditions::create(settings_.model.config, tile->cells, objects));
        std::vector<float> row(told.width());
        for (uint32_t c = 0; c < tile->cells.cells.size() && !told.empty(); ++c) {
            told.row(c, tile->cells.cells[c], row);
            add(row);
        }
    }
    for (const TileIndex& seen : tiles_seen_by(index)) {
        SR_TRY(const uint64_t key, key_of(seen));
        add(std::array{key});
    }
    tile->key = hash.value(); // note: what a map holds stays where it is while others are brought
    return *tile->key;
}

Result<bool> WorldTiles::load(const TileIndex& index)
{
    if (stores_ && waiting_.contains(index))
        SR_CHECK(drain());
    std::error_code ignored;
    if (cache_.empty() || !std::filesystem::exists(path_of(index), ignored))
        return false;
    SR_TRY(WorldTile * tile, bring(index));
    SR_TRY(const uint64_t key, key_of(index));
    const auto stored = read_grid(path_of(index));
    if (!stored) // damaged: it is made anew
        return false;
    const auto entry = stored->metadata.find("key");
    const bool same = entry != stored->metadata.end() && entry->second == hash_text(key) &&
                      stored->cells == tile->cells.cells && stored->labels == tile->cells.labels &&
                      stored->points_per_voxel == int(settings_.model.config.points_per_voxel);
    if (!same || !stored->has_points() || std::ranges::count(stored->generated, 0))
        return false;
    tile->cells.points_per_voxel = stored->points_per_voxel;
    tile->cells.points = stored->points;
    tile->cells.colors = stored->colors;
    tile->cells.generated = stored->generated;
    tile->finished = tile->stored = true;
    return true;
}

Result<VoxelGrid> WorldTiles::cut(std::span<const TileIndex> targets)
{
    VoxelGrid part;
    part.voxel_size = labels_.voxel_size();
    part.points_per_voxel = int(settings_.model.config.points_per_voxel);
    std::set<TileIndex> seen;
    for (const TileIndex& target : targets) {
        SR_ASSERT(tile_colour(target) == tile_colour(targets[0]), "tiles of two colours at a time");
        SR_TRY(WorldTile * tile, bring(target));
        make_room_for_points(tile->cells, part.points_per_voxel);
        append_cells(part, tile->cells);
        for (const TileIndex& other : tiles_seen_by(target))
            seen.insert(other);
    }
    for (const TileIndex& other : seen) {
        SR_TRY(const WorldTile* tile, bring(other));
        SR_ASSERT(tile->finished, "tile ({}, {}) is seen before it is finished", other[0], other[1]);
        for (size_t c = 0; c < tile->cells.cells.size(); ++c)
            if (std::ranges::any_of(targets, [&](const TileIndex& target) {
                    return tile_window(target, edge(), settings_.regions.halo_cells).holds(tile->cells.cells[c]);
                }))
                append_cell(part, tile->cells, c);
    }
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
            SR_ASSERT(found && part.generated[*found], "a cell of a finished tile has no points");
            std::copy_n(&part.points[*found * width], width, &tile.cells.points[c * width]);
            std::copy_n(&part.colors[*found * width], width, &tile.cells.colors[c * width]);
            tile.cells.generated[c] = 1;
        }
        tile.finished = true;
    }
    if (!files_ || !stores_)
        return {};
    for (const TileIndex& target : targets)
        if (stores_)
            stores_ = write(target, tiles_.at(target));
    return stores_;
}

Status WorldTiles::write(const TileIndex& index, WorldTile& from)
{
    SR_TRY(const uint64_t key, key_of(index));
    VoxelGrid file = from.cells;
    file.metadata = {{"key", hash_text(key)}, {"tool", kProgram}};
    SR_CHECK(files_->push([path = path_of(index), file = std::move(file)] { return write_grid(path, file); }));
    from.stored = true;
    waiting_.insert(index);
    return {};
}

Status WorldTiles::drain()
{
    if (files_ && stores_)
        stores_ = files_->drain();
    waiting_.clear();
    return stores_;
}

Result<std::vector<TileIndex>> WorldTiles::edit(const LabelEdits& edits)
{
    std::set<TileIndex> changed;
    for (const auto& [cell, label] : edits) {
        const TileIndex tile = tile_of(cell, edge());
        edits_[tile][cell] = label;
        changed.insert(tile);
    }
    std::set<TileIndex> spoiled = changed;
    for (const TileIndex& tile : changed)
        for (const TileIndex& other : tiles_that_see(tile))
            spoiled.insert(other);
    for (const TileIndex& tile : spoiled)
        tiles_.erase(tile); // its labels are read again
    return std::vector<TileIndex>(spoiled.begin(), spoiled.end());
}

} // namespace semrover
