// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/label_edits.h"
#include "engine/voxfield/tile_regions.h"
#include "engine/world/generation_settings.h"
#include "engine/world/tile_store.h"
#include "engine/world/world_objects.h"

#include <unordered_set>

namespace semrover {

struct WorldTile {
    VoxelGrid cells; // labels with the edits, and room for points from the time when they are generated on
    std::vector<uint8_t> known = {};  // voxels that have points in the source; empty: none
    bool finished = false;            // all voxels have points
    bool fresh = false;               // finished by the source, and not announced
    bool stored = false;              // the store has it
    std::optional<uint64_t> key = {}; // of all that decides its points; where it is known
    uint64_t bytes = 0;               // on the host
};

// The tiles of a world that are in memory, and their store. A tile's key names all that its points depend on. Places
// without voxels are known as such, and cost no memory that counts.
class WorldTiles {
  public:
    // settings and labels outlive this. base: names model, settings and seed. store: NULL: none
    WorldTiles(const GenerationSettings& settings, WorldLabels& labels, WorldObjects objects,
               std::unique_ptr<TileStore> store, uint64_t base);

    // brings a tile's labels, and nothing else; NULL: it has no voxels. Errors: of the source
    Result<WorldTile*> bring(const TileIndex& tile);
    // one that is in memory, or NULL
    const WorldTile* find(const TileIndex& tile) const;
    bool is_empty(const TileIndex& tile) const { return empty_.contains(tile); }
    const std::map<TileIndex, WorldTile>& all() const { return tiles_; }
    uint64_t bytes() const { return bytes_; } // of all in memory
    // that a tile will have with points
    uint64_t bytes_with_points(const WorldTile& tile) const;
    TileStore* store() { return store_.get(); }

    // takes a tile from the store; false: it is not there. Errors: of the source
    Result<bool> load(const TileIndex& tile);
    // The voxels of tiles of one colour as targets, with what they know around them. What tiles see must be finished.
    Result<VoxelGrid> cut(std::span<const TileIndex> tiles);
    // the model's conditioning on them
    Result<std::vector<SceneObject>> objects_near(std::span<const TileIndex> tiles);
    // Takes the points of the targets of a grid that cut() gave, then hands them to the store. After an error, which is
    // the store's, they are finished nevertheless
    Status finish(std::span<const TileIndex> tiles, const VoxelGrid& part);
    Status keep(const TileIndex& tile); // hands one to the store whose points are all the source's

    // what is edited, by the tiles whose points it changes
    std::vector<TileIndex> edit(const LabelEdits& edits);
    void drop(const TileIndex& tile);
    void keep_objects_near(const CellWindow& window) { objects_.keep_near(window); }

  private:
    int32_t edge() const { return settings_.regions.tile_cells; }
    void count(WorldTile& tile); // its bytes, after a change
    Result<uint64_t> key_of(const TileIndex& tile);
    Status add_known(VoxelGrid& part, const TileIndex& tile, std::span<const TileIndex> targets, bool seen);
    Status write(const TileIndex& tile, WorldTile& from);

    struct IndexHash {
        size_t operator()(const TileIndex& tile) const
        {
            return size_t(uint64_t(uint32_t(tile[0])) << 32 | uint32_t(tile[1])) * 0x9e3779b97f4a7c15ull;
        }
    };

    const GenerationSettings& settings_;
    WorldLabels& labels_;
    WorldObjects objects_;
    std::unique_ptr<TileStore> store_;
    uint64_t base_, bytes_ = 0;
    std::map<TileIndex, WorldTile> tiles_;
    std::unordered_set<TileIndex, IndexHash> empty_;
    std::map<TileIndex, LabelEdits> edits_;
};

} // namespace semrover
