// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/splat/splat_pool.h"
#include "engine/world/world_foci.h"
#include "engine/world/world_tiles.h"

namespace semrover {

struct WorldSplatOptions {
    uint64_t bytes = 0; // of device memory
    PointSplatOptions points = {.auto_sigma = true};
    double detail_distance = 0;                // as in WorldRequest
    float voxel_size = 0;                      // metres
    double edge = 0;                           // of a tile, metres
    std::span<const SceneObject> objects = {}; // that splats are of; outlives this
};

// Which finished tiles of a world have splats, and of which detail. A tile's are made anew when neighbours have come
// whose points lie at its border, when foci move so that another detail suits it, and after an edit; until then the old
// ones stay. One tile at a time, as pieces of the world's work.
class WorldSplats {
  public:
    // tiles: outlives this. Errors: of SplatPool::create()
    static Result<std::unique_ptr<WorldSplats>> create(Device& device, const WorldTiles& tiles,
                                                       const WorldSplatOptions& options);

    SplatPool& pool() { return *pool_; }

    // of what is wanted now; none: everything
    void want(const WorldFoci& foci);
    void find_bare(); // looks through all tiles for those whose splats are to be made
    void begin_step() { no_room_yet_ = false; }
    bool has_work() const { return !bare_.empty() && !no_room_yet_; }
    Status make_next();                 // of the first of them; needs has_work()
    bool full() const { return full_; } // there was no room for all, or not in full detail

    void came(const TileIndex& tile); // it is finished
    void went(const TileIndex& tile);
    void edited(const TileIndex& tile); // its splats stay until there are others
    bool is_stale(const TileIndex& tile) const { return stale_.contains(tile); } // they are those before an edit

  private:
    // of which detail, and beside which neighbours
    struct MadeFor {
        uint32_t detail;
        uint8_t neighbours;
    };

    WorldSplats(const WorldTiles& tiles, const WorldSplatOptions& options) : tiles_(tiles), options_(options) {}
    const VoxelGrid* finished(const TileIndex& tile) const; // its voxels, or null
    uint32_t detail(const TileIndex& tile) const;
    bool has_splats(const TileIndex& tile) const;
    uint8_t neighbours_with_points(const TileIndex& tile) const;
    bool neighbours_are_settled(const TileIndex& tile) const;
    void append_neighbours(const TileIndex& tile, float reach, float thinned_by, ScenePoints& points) const;
    Result<SplatPool::Room> add(const TileIndex& tile, const VoxelGrid& cells, uint32_t detail);
    void drop(const TileIndex& tile);

    const WorldTiles& tiles_;
    const WorldSplatOptions options_;
    std::unique_ptr<SplatPool> pool_;
    WorldFoci foci_;
    std::vector<TileIndex> bare_; // finished tiles whose splats are made next
    std::map<TileIndex, MadeFor> made_for_;
    std::set<TileIndex> stale_;
    bool no_room_yet_ = false; // in this step
    bool full_ = false;
};

// How coarse a tile at that distance is: 0 within `detail_distance`, 1 up to twice as far, 2 up to four times, and so
// on to kCoarsestDetail; always 0 where detail_distance is 0.
constexpr uint32_t kCoarsestDetail = 5;
uint32_t detail_of(double away, double detail_distance);

} // namespace semrover
