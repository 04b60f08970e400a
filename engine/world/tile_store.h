// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/file_queue.h"
#include "engine/scene/tiles.h"

#include <memory>
#include <set>

namespace semrover {

// A folder of tiles (tiles.h) that a world fills: files have their keys in their names, so that worlds of other seeds,
// settings or edits share a folder and no one's files go. The index names the tiles of the world that wrote it last.
// A folder that cannot be written is only read.
class TileStore {
  public:
    // world: names the world; where the folder's index is of the same one, its entries stay.
    // Errors: bad_input, where the folder is not there and cannot be made
    static Result<std::unique_ptr<TileStore>> open(const Path& folder, const TileFolderInfo& info, uint64_t world);

    const Status& writable() const { return writable_; } // why it is only read
    const Status& status() const { return status_; }     // of the writes so far
    // none: it is not there, or damaged
    std::optional<VoxelGrid> read(const TileIndex& tile, uint64_t key);
    // Hands a tile to a thread that writes it. After a failure nothing more is written, and each call returns its error
    Status write(const TileIndex& tile, uint64_t key, VoxelGrid cells);
    void forget(const TileIndex& tile); // takes it out of the index
    template <typename F>
    void name_only(F wanted) // and all others
    {
        changed_ = std::erase_if(entries_, [&](const auto& entry) { return !wanted(entry.first); }) > 0 || changed_;
    }
    // Waits until all is written, and writes the index. Errors: of any write before it
    Status flush();

  private:
    TileStore(const Path& folder, const TileFolderInfo& info) : folder_(folder), info_(info) {}

    Path folder_;
    TileFolderInfo info_;
    std::map<TileIndex, TileEntry> entries_;
    bool changed_ = false;        // the index is not that of entries_
    std::set<TileIndex> waiting_; // handed over, and may not have their files yet
    Status writable_, status_;    // status_: of the writes so far
    std::unique_ptr<FileQueue> files_;
};

} // namespace semrover
