// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/job/file_queue.h"
#include "engine/job/generation_settings.h"
#include "engine/job/world_objects.h"
#include "engine/scene/label_edits.h"
#include "engine/voxfield/tile_regions.h"

#include <set>

namespace semrover {

struct WorldTile {
    VoxelGrid cells;       // labels with the edits, and room for points from the time when they are generated on
    bool finished = false; // has points, or nothing that needs any
    bool stored = false;   // the cache has it
    std::optional<uint64_t> key = {}; // of all that decides its points; where it is known

    uint64_t bytes() const; // on the host
};

// The tiles of a world that are in memory, and their cache folder: CACHE/tile_X_Y.sgrid, with a key in its metadata
// that names all that its points depend on. A file with another key is generated anew.
class WorldTiles {
  public:
    // settings and labels outlive this. cache: a folder, made where it is missing; empty: none.
    // base: names model, settings and seed
    static Result<std::unique_ptr<WorldTiles>> create(const GenerationSettings& settings, WorldLabels& labels,
                                                      WorldObjects objects, const Path& cache, uint64_t base);

    // brings a tile's labels, and nothing else. Errors: of the source
    Result<WorldTile*> bring(const TileIndex& tile);
    bool in_memory(const TileIndex& tile) const { return tiles_.contains(tile); }
    const std::map<TileIndex, WorldTile>& all() const { return tiles_; }
    uint64_t bytes() const; // of all in memory
    // that a tile will have with points
    uint64_t bytes_with_points(const WorldTile& tile) const;

    // takes a tile from the cache; false: it is not there. Errors: bad_input only for what the world did not write
    Result<bool> load(const TileIndex& tile);
    // The cells of tiles of one colour as targets, with what they know around them. What tiles see must be finished.
    Result<VoxelGrid> cut(std::span<const TileIndex> tiles);
    // what the model is told of them
    Result<std::vector<SceneObject>> objects_near(std::span<const TileIndex> tiles);
    // Takes the points of the targets of a grid that cut() gave, then hands them to the cache. After an error they are
    // finished nevertheless. A cache that cannot be written is told once, here or by load(), and nothing more goes
    // there
    Status finish(std::span<const TileIndex> tiles, const VoxelGrid& part);
    Status drain(); // until the cache has all that is finished; an error where it does not

    // what is edited, by the tiles whose points it changes
    Result<std::vector<TileIndex>> edit(const LabelEdits& edits);
    void drop(const TileIndex& tile) { tiles_.erase(tile); }
    void keep_objects_near(const CellWindow& window) { objects_.keep_near(window); }

  private:
    WorldTiles(const GenerationSettings& settings, WorldLabels& labels, WorldObjects objects, const Path& cache,
               uint64_t base);
    int32_t edge() const { return settings_.regions.tile_cells; }
    Path path_of(const TileIndex& tile) const { return cache_ / tile_name(tile); }
    Result<uint64_t> key_of(const TileIndex& tile);
    Status write(const TileIndex& tile, WorldTile& from);

    const GenerationSettings& settings_;
    WorldLabels& labels_;
    WorldObjects objects_;
    Path cache_;
    uint64_t base_;
    std::map<TileIndex, WorldTile> tiles_;
    std::map<TileIndex, LabelEdits> edits_;
    std::set<TileIndex> waiting_;      // handed to the cache since it was drained, which may not have their files yet
    Status stores_;                    // whether the cache takes what is finished
    std::unique_ptr<FileQueue> files_; // of the cache
};

} // namespace semrover
