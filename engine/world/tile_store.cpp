// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/tile_store.h"

#include "runtime/base/hash.h"

namespace semrover {

namespace {

uint64_t bytes_of(const VoxelGrid& g)
{
    return g.cells.size() * sizeof(Cell) + g.labels.size() + g.points.size() * 2 + g.colors.size() + g.generated.size();
}

} // namespace

Result<std::unique_ptr<TileStore>> TileStore::open(const Path& folder, const TileFolderInfo& info, uint64_t world)
{
    std::unique_ptr<TileStore> store(new TileStore(folder, info));
    store->info_.metadata["world"] = hash_text(world);
    SR_CHECK(make_folder(folder));
    store->writable_ = AtomicFile::create(folder / "writable").map([](const AtomicFile&) {});
    if (const auto before = TileFolder::open(folder))
        if (const auto of = before->metadata().find("world");
            of != before->metadata().end() && of->second == hash_text(world))
            store->entries_ = before->tiles();
    store->files_ = std::make_unique<FileQueue>(1);
    return store;
}

std::optional<VoxelGrid> TileStore::read(const TileIndex& tile, uint64_t key)
{
    if (waiting_.contains(tile)) {
        status_ = files_->drain();
        waiting_.clear();
    }
    const std::string name = tile_name(tile, hash_text(key));
    if (!is_there(folder_ / name))
        return std::nullopt;
    auto cells = read_grid(folder_ / name);
    if (!cells)
        return std::nullopt;
    const TileEntry entry{cells->cells.size(), hash_text(key)};
    changed_ = changed_ || !entries_.contains(tile) || entries_.at(tile) != entry;
    entries_[tile] = entry;
    return std::move(*cells);
}

Status TileStore::write(const TileIndex& tile, uint64_t key, VoxelGrid cells)
{
    if (!writable_)
        return {};
    SR_CHECK(status_);
    const TileEntry entry{cells.cells.size(), hash_text(key)};
    const uint64_t bytes = bytes_of(cells);
    waiting_.insert(tile);
    status_ =
        files_->push(bytes,
                     [path = folder_ / tile_name(tile, hash_text(key)),
                      cells = std::move(cells)]() mutable -> Result<FileQueue::Commit> {
                         return [path = std::move(path), cells = std::move(cells)] { return write_grid(path, cells); };
                     });
    if (status_) { // the index names no tile that is not on its way
        entries_[tile] = entry;
        changed_ = true;
    }
    return status_;
}

void TileStore::forget(const TileIndex& tile)
{
    changed_ = entries_.erase(tile) > 0 || changed_;
}

Status TileStore::flush()
{
    if (status_)
        status_ = files_->drain();
    waiting_.clear();
    SR_CHECK(status_);
    if (!changed_ || !writable_ || entries_.empty())
        return {};
    SR_CHECK(write_tile_index(folder_, info_, entries_));
    changed_ = false;
    return {};
}

} // namespace semrover
