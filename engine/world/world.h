// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/voxfield/sub_grid.h"
#include "engine/world/grid_filling.h"
#include "engine/world/world_order.h"
#include "engine/world/world_splats.h"
#include "engine/world/world_tiles.h"

namespace semrover {

// What is generated, of which labels and with which settings. settings.regions.tile_cells says in which order
// (docs/method.md §4):
// - above 0 the order of tiles: the bytes of a place depend on model, seed, labels and edits near it. Which way the
//   camera came, what was dropped and how much was done at a time do not matter.
// - 0 the order of the scene: all labels at once, as one part.
// Without a model (settings.model is none) a world shows the points that the source has, in the order of tiles.
struct WorldRequest {
    GenerationSettings settings = {};
    std::shared_ptr<const Transformer> transformer = {}; // of the settings' model, shared; none: one of its own
    uint64_t seed = 0;
    GivenObjects objects = {};  // that condition the model; none: guessed of the labels, block by block or at once
    uint32_t tiles_at_once = 0; // that are generated together; 0: what suits the device. Does not change the bytes
    Path store = {};            // a folder that keeps finished tiles (TileStore), for other sessions too; empty: none
    bool any_device = false;    // what another device or driver left there is taken, too
    std::map<std::string, std::string> metadata = {}; // of the store's index
    uint64_t host_bytes = 0;                          // of tiles in memory; 0: no budget
    uint64_t splat_bytes = 0; // of splats on the device, all allocated at the beginning; 0: none are made
    PointSplatOptions splats = {.auto_sigma = true};
    // metres from the focus within which a tile has a splat of each of its points. Up to twice as far it has one of
    // each half voxel, and so on: half as many along each axis whenever the distance doubles (detail_of). 0: all
    // everywhere
    double detail_distance = 0;
    // the order of the scene: the voxels to generate, ascending, of which nothing else changes (docs/method.md §4.3).
    // Empty: all that have no points
    std::vector<uint32_t> targets = {};
};

struct WorldFigures {
    size_t wanted = 0, finished = 0;     // tiles that are wanted, and those of them that are known to be finished
    size_t in_memory = 0;                // tiles
    uint64_t host_bytes = 0;             // of these
    uint64_t generated = 0, dropped = 0; // tiles so far: made, forgotten
    uint64_t loaded = 0;                 // taken from the store or, where it has all their points, from the source
    bool full = false;                   // a budget has no room for more of what is wanted
};

// The only driver of generation: points for labels, as far as they are wanted, a piece of work at a time.
class World {
  public:
    World(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels, const JobCallbacks& callbacks);
    ~World() { (void)filling_.cancel(); }
    World(const World&) = delete;

    // Loads the model, plans memory and compiles, so that no step does. See open_world.
    Status open();

    // What is wanted from now on; tiles that are at work are finished first. Foci that moved by less than an eighth of
    // a tile are the same. Errors: of check_foci()
    Status focus(const WorldFoci& foci);
    // The tiles within `horizon` metres of a track. Those that nothing wanted needs any more leave memory once the
    // store has them. usage: a horizon that is not above 0 and up to 1000 m
    Status follow(std::span<const GroundPoint> track, double horizon);
    // All that the source has. run: keeps finished regions of the order of the scene, and gives those that it has; it
    // outlives the world. usage: the source has no end
    Status everywhere(RunFolder* run = nullptr);

    // Works as long as the budget allows: one piece of work at least, and no piece that is expected not to fit, going
    // by those of its kind before. true: nothing is left to do, but for splats that wait for rows which are still
    // looked at. What became of splats is published at its end. A step waits for what it submits if the budget is
    // timed. Errors: of the source, of the device; those tiles are tried again by the next step. In the order of the
    // scene only the destructor may follow
    Result<bool> step(const JobBudget& budget);

    // Sets labels, or takes voxels away. Their tiles and those that see them are generated anew; what was finished of
    // them is gone at once, but their splats stay until the new ones are there. Errors: of check_edits(); nothing is
    // changed then
    Status edit(const LabelEdits& edits);
    Status check_edits(const LabelEdits& edits) const; // bad_input: beyond 2^20, unknown labels; any thread
    // The source knows the labels of a window that it did not know yet (kNotYet): the tiles that wait for them are
    // asked for again
    void labels_ready(const CellWindow& window);

    // voxels of a finished tile that is in memory, or null: sorted, each with points. Valid until the next call.
    const VoxelGrid* tile(const TileIndex& tile) const;
    // copies of the finished voxels of a window that are in memory; all of them
    VoxelGrid cells(const CellWindow& window) const;
    // those that were given: splats know which of them they are of
    std::span<const SceneObject> objects() const;
    // the order of the scene: the grid, filled as far as it is done
    const VoxelGrid& scene() const { return scene_->grid; }
    int32_t tile_cells() const { return request_.settings.regions.tile_cells; }
    float voxel_size() const { return has_model() ? request_.settings.model.config.voxel_size : labels_->voxel_size(); }
    int points_per_voxel() const
    {
        return has_model() ? int(request_.settings.model.config.points_per_voxel) : labels_->points_per_voxel();
    }
    WorldFigures figures() const;
    // voxels, planned_device_bytes, peak_device_bytes, and what the order has beside: tiles, or regions, seconds
    Json results() const;
    // What is wanted would take: voxels, regions, batch, steps, peak_device_bytes, seconds (about), device. Nothing
    // else may follow. runs: as many of the same
    Result<Json> estimate(size_t runs = 1);

    // splats of finished tiles; at a border, normals and sizes go by the points on both sides, once they are there.
    // Null without splat_bytes
    SplatPool* splats() const { return splats_ ? &splats_->pool() : nullptr; }

    // Whether the store takes what is finished. A world goes on without: its tiles stay in memory, as far as budgets
    // allow, and a warning says so once
    Status stored() const { return tiles_->store() ? tiles_->store()->status() : Status(); }
    // bad_input: the store can only be read
    Status can_store() const { return tiles_->store() ? tiles_->store()->writable() : Status(); }
    // waits until the store has all that is finished, and its index; an error where it has not
    Status flush();

  private:
    // pieces of work, which take different times
    enum class Piece : uint8_t { look, load, cut, first_row, row, last_row, finish, splats };
    static constexpr size_t kPieces = 8;
    // what the order of the scene works on
    struct Scene {
        VoxelGrid grid;
        SubGrid part; // of the targets, where there are any
    };

    bool has_model() const { return !request_.settings.model.folder.empty(); }
    double edge() const; // of a tile, metres
    bool finished(const TileIndex& tile) const;
    Status open_scene();
    Status open_tiles();
    Status warm_up();
    void want(TileOrder order, WorldFoci foci);
    void look_again();
    Piece next_piece() const;
    Status do_piece(Piece piece);
    Status load_next();
    Status look();
    Result<bool> look_at(const TileIndex& tile);
    void passed();
    Status leave_out_work();
    void end_look();
    Result<std::optional<TileIndex>> missing(const TileIndex& tile);
    bool is_kept(const TileIndex& tile, size_t rank) const;
    Result<bool> room_for(const TileIndex& wanted, size_t rank);
    Status drop(const TileIndex& tile);
    void release_around(const TileIndex& tile);
    Status cut();
    Status finish();
    void say(bool ended = false) const;
    void give_up();
    void came(const TileIndex& tile, uint64_t& count);
    bool wants_splats() const { return splats_ && splats_->has_work(); }

    const WorldRequest request_;
    const JobCallbacks callbacks_;
    std::unique_ptr<WorldLabels> labels_;
    std::unique_ptr<WorldTiles> tiles_; // the order of tiles
    std::optional<Scene> scene_;        // or that of the scene
    GridFilling filling_;
    WorldFoci foci_;
    bool releases_ = false; // what is finished leaves memory
    TileOrder order_;
    size_t done_ = 0, rank_ = 0;   // of order_: finished from the front on, and where to look next
    std::set<size_t> ahead_;       // finished ranks after done_
    std::set<TileIndex> released_; // finished tiles that left memory
    std::set<TileIndex> waiting_;  // for labels that the source does not know yet
    uint32_t at_once_ = 1;
    bool idle_ = true, full_ = false, warned_ = false; // warned_: that the store takes nothing more
    std::vector<TileIndex> found_;                     // what is generated next
    std::vector<TileIndex> loading_;                   // taken from the store next
    std::set<TileIndex> not_stored_;                   // the store does not have them
    std::vector<TileIndex> work_;                      // tiles that are being generated
    bool cut_ = false, filled_ = false;                // how far they are
    VoxelGrid part_;                                   // they, and what they know
    std::unique_ptr<WorldSplats> splats_;
    std::array<SubmitCost, kPieces> costs_;
    uint64_t generated_ = 0, loaded_ = 0, dropped_ = 0, cells_ = 0;
    uint64_t planned_bytes_ = 0;
};

// The device outlives the world. Errors: usage, bad_input (settings, objects, labels, the store), out_of_memory
Result<std::unique_ptr<World>> open_world(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels,
                                          const JobCallbacks& callbacks = {});

} // namespace semrover
