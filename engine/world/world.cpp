// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world.h"

#include "engine/conditioning/object_blocks.h"
#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "runtime/base/hash.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kMostHorizon = 1000;        // likewise
constexpr uint64_t kNoDeadline = 1ull << 60; // microseconds
constexpr size_t kTilesALook = 64;           // most of which need nothing

} // namespace

World::World(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels, const JobCallbacks& callbacks)
    : request_(std::move(request)), callbacks_(callbacks), labels_(std::move(labels)),
      filling_(device, request_.settings, request_.transformer)
{
}

double World::edge() const
{
    return tile_cells() * decimal_voxel_size(voxel_size());
}

bool World::finished(const TileIndex& tile) const
{
    const WorldTile* there = tiles_->find(tile);
    return (there && there->finished) || tiles_->is_empty(tile) || released_.contains(tile);
}

Status World::open()
{
    return tile_cells() ? open_tiles() : open_scene();
}

Status World::open_scene()
{
    const GenerationSettings& s = request_.settings;
    scene_.emplace();
    SR_TRY(scene_->grid, labels_->take());
    SR_TRY(const std::vector<SceneObject> objects,
           conditioning_objects(s.model, request_.objects, scene_->grid, request_.seed));
    RegionOptions regions = s.regions;
    if (!request_.targets.empty()) {
        SR_TRY(scene_->part, cut_sub_grid(scene_->grid, request_.targets, cells_considered(regions)));
        regions.from_known = true;
    }
    SR_CHECK(filling_.cut(request_.targets.empty() ? scene_->grid : scene_->part.grid, regions, objects));
    return filling_.load(request_.seed, callbacks_);
}

// names model, settings and seed: what the keys of tiles are made of beside labels and objects
Status World::open_tiles()
{
    const GenerationSettings& s = request_.settings;
    if (!has_model()) {
        tiles_ = std::make_unique<WorldTiles>(s, *labels_, WorldObjects::none(s.model), nullptr, 0);
        return warm_up();
    }
    SR_CHECK(check_tile_options(s.regions));
    if (std::abs(labels_->voxel_size() - voxel_size()) > 1e-4f * voxel_size())
        return fail(ErrorCode::bad_input, "the labels have voxels of {} m, the model was trained on {} m",
                    labels_->voxel_size(), voxel_size());
    if (labels_->points_per_voxel() && labels_->points_per_voxel() != points_per_voxel())
        return fail(ErrorCode::bad_input, "the labels come with {} points a voxel, the model makes {}",
                    labels_->points_per_voxel(), points_per_voxel());
    SR_TRY(Json settings, settings_json(s, filling_.device(), "world", 0));
    if (request_.any_device) {
        settings.erase("device");
        settings.erase("driver");
    }
    Hash base;
    base.add(json_text(settings));
    base.add(std::as_bytes(std::span(&request_.seed, 1)));
    SR_TRY(WorldObjects objects, WorldObjects::create(s.model, request_.objects, request_.seed));
    std::unique_ptr<TileStore> store;
    if (!request_.store.empty()) {
        const TileFolderInfo info{labels_->voxel_size(), tile_cells(), points_per_voxel(), true, request_.metadata};
        SR_TRY(store, TileStore::open(request_.store, info, base.value()));
    }
    tiles_ = std::make_unique<WorldTiles>(s, *labels_, std::move(objects), std::move(store), base.value());
    at_once_ = request_.tiles_at_once;
    if (!at_once_) // a GPU wants more regions at once than one tile has ready; not measured
        at_once_ = filling_.device().limits().type == DeviceType::cpu ? 1 : 4;
    return warm_up();
}

// the first step of a region as large as regions get, and splats
Status World::warm_up()
{
    RegionOptions options = request_.settings.regions;
    options.tile_cells = 0;
    VoxelGrid grid;
    grid.voxel_size = voxel_size();
    for (int32_t i = 0; i < options.region_size; ++i)
        grid.cells.push_back({i / 16, i % 16, 0});
    grid.labels.assign(grid.cells.size(), 0);
    make_room_for_points(grid, std::max(points_per_voxel(), 1));
    if (has_model()) {
        SR_CHECK(filling_.cut(grid, options));
        SR_CHECK(filling_.load(request_.seed, callbacks_));
        SR_TRY(planned_bytes_, filling_.bound_bytes());
        SR_CHECK(filling_.start(nullptr));
        SR_CHECK(filling_.step({.submits = 2, .microseconds = kNoDeadline}).map([](bool) {}));
        SR_CHECK(filling_.cancel());
    }
    if (!request_.splat_bytes)
        return {};
    SR_TRY(splats_, WorldSplats::create(filling_.device(), *tiles_,
                                        {.bytes = request_.splat_bytes,
                                         .points = request_.splats,
                                         .detail_distance = request_.detail_distance,
                                         .voxel_size = voxel_size(),
                                         .edge = edge(),
                                         .objects = objects()}));
    grid.generated.assign(grid.cells.size(), 1); // points in the middle of their voxels
    return splats_->pool().prepare(points_of(grid).size(), request_.splats);
}

std::span<const SceneObject> World::objects() const
{
    return request_.objects ? std::span<const SceneObject>(*request_.objects) : std::span<const SceneObject>();
}

Status World::focus(const WorldFoci& foci)
{
    SR_ASSERT(tiles_, "foci need the order of tiles");
    SR_CHECK(check_foci(foci, voxel_size()));
    if (is_nearly(foci_, foci, edge()))
        return {};
    releases_ = false;
    want(TileOrder(foci, edge()), foci);
    return {};
}

Status World::follow(std::span<const GroundPoint> track, double horizon)
{
    SR_ASSERT(tiles_ && !track.empty(), "a track needs the order of tiles");
    if (!(horizon > 0 && horizon <= kMostHorizon))
        return fail(ErrorCode::usage, "a horizon: expected metres above 0 and up to {}, found {}", kMostHorizon,
                    horizon);
    releases_ = true;
    want(TileOrder(tiles_along(track, horizon, edge())), {});
    say();
    return {};
}

Status World::everywhere(RunFolder* run)
{
    if (scene_) {
        SR_CHECK(filling_.start(run));
        work_.emplace_back();
        cut_ = true;
        filling_.say(callbacks_);
        return {};
    }
    SR_TRY(std::vector<TileIndex> all, labels_->tiles(tile_cells()));
    releases_ = false;
    want(TileOrder(std::move(all)), {});
    say();
    return {};
}

void World::want(TileOrder order, WorldFoci foci)
{
    foci_.clear(); // until all is as they want it: what throws here is asked for again
    order_ = std::move(order);
    released_.clear();
    waiting_.clear();
    full_ = false;
    look_again();
    if (splats_)
        splats_->want(foci);
    if (has_model() && !foci.empty())
        tiles_->keep_objects_near(window_around(foci, 2 * edge(), voxel_size()));
    foci_ = std::move(foci);
}

World::Piece World::next_piece() const
{
    if (wants_splats())
        return Piece::splats;
    if (work_.empty())
        return loading_.empty() ? Piece::look : Piece::load;
    if (!cut_)
        return Piece::cut;
    if (filled_)
        return Piece::finish;
    return filling_.begins_batch() ? Piece::first_row : filling_.ends_batch() ? Piece::last_row : Piece::row;
}

// rows are stepped here, not in do_piece(): few calls lie between an application and a submit
Result<bool> World::step(const JobBudget& budget)
{
    BudgetMeter meter(budget);
    if (splats_)
        splats_->begin_step();
    bool spent = false; // something was done already
    Result<bool> done = true;
    while (!idle_ || !work_.empty() || wants_splats()) {
        const Piece piece = next_piece();
        const bool submits = piece == Piece::first_row || piece == Piece::row || piece == Piece::last_row;
        SubmitCost& cost = costs_[size_t(piece)];
        if (spent && !meter.room_for(cost.bound())) {
            done = false;
            break;
        }
        const Status status = unless_memory_is_short([&]() -> Status {
            if (submits) {
                SR_TRY(filled_, filling_.step({.submits = 1, .microseconds = budget.timed() ? kNoDeadline : ~0ull}));
            } else {
                SR_CHECK(do_piece(piece));
            }
            return scene_ && filled_ ? finish() : Status();
        });
        if (!status) {
            if (!filled_) // else it is made, and finished in the next step
                give_up();
            done = tl::make_unexpected(status.error());
            break;
        }
        say();
        meter.spent(cost, submits);
        spent = true;
    }
    if (done && *done)
        say(true);
    if (splats_)
        SR_CHECK(splats_->pool().publish());
    return done;
}

Status World::do_piece(Piece piece)
{
    switch (piece) {
    case Piece::look:
        return look();
    case Piece::load:
        return load_next();
    case Piece::splats:
        return splats_->make_next();
    case Piece::cut:
        return cut();
    case Piece::finish:
        return finish();
    case Piece::first_row:
    case Piece::row:
    case Piece::last_row:
        break;
    }
    SR_ASSERT(false, "a row is a step of the filling");
    return {};
}

Status World::load_next()
{
    const TileIndex tile = loading_.back();
    const auto there = tiles_->load(tile);
    if (!there && there.error().code == kNotYet) {
        waiting_.insert(tile);
    } else {
        SR_TRY(const bool stored, there);
        if (stored)
            came(tile, loaded_);
        else
            not_stored_.insert(tile);
    }
    loading_.pop_back(); // last: what fails before is tried again
    return {};
}

// the first tile that is not finished among `tile` and those that it sees, lower colours first
Result<std::optional<TileIndex>> World::missing(const TileIndex& tile)
{
    if (released_.contains(tile))
        return std::optional<TileIndex>();
    if (waiting_.contains(tile))
        return fail(kNotYet, "labels of tile ({}, {}) are not there yet", tile[0], tile[1]);
    SR_TRY(WorldTile * own, tiles_->bring(tile));
    if (!own) {
        if (splats_ && splats_->is_stale(tile)) // an edit took its last voxel away
            splats_->went(tile);
        return std::optional<TileIndex>();
    }
    if (own->finished) {
        if (own->fresh) {
            (void)tiles_->keep(tile); // the store's error is stored()
            came(tile, loaded_);
            own->fresh = false;
        }
        return std::optional<TileIndex>();
    }
    if (tiles_->store() && !not_stored_.contains(tile))
        return std::optional(tile); // the store may have it
    for (const TileIndex& seen : tiles_seen_by(tile)) {
        SR_TRY(const auto first, missing(seen));
        if (first)
            return first;
    }
    return std::optional(tile);
}

// finds what to do next: a tile of the store, or tiles of one colour that wait for none
Status World::look()
{
    for (size_t looked = 0; looked < kTilesALook; ++looked) {
        const std::optional<TileIndex> tile = order_.at(rank_);
        const bool far = !found_.empty() && rank_ > done_ + 4 * at_once_; // it would come before what is near
        if (!tile || far || found_.size() >= at_once_) {
            end_look();
            return {};
        }
        SR_TRY(const bool goes_on, look_at(*tile));
        if (!goes_on)
            return {};
    }
    return {};
}

// at the tile whose turn it is; false: something was found that is done at once
Result<bool> World::look_at(const TileIndex& tile)
{
    auto missed = missing(tile);
    if (!missed && missed.error().code == kNotYet) {
        waiting_.insert(tile);
        passed();
        return true;
    }
    SR_TRY(const auto first, std::move(missed));
    if (!first) {
        passed();
        if (releases_)
            release_around(tile);
        return true;
    }
    const bool stored = tiles_->store() && !not_stored_.contains(*first);
    const bool fits = found_.empty() ||
                      (!stored && !std::ranges::count(found_, *first) && tile_colour(*first) == tile_colour(found_[0]));
    if (!fits) {
        ++rank_;
        return true;
    }
    SR_TRY(const bool room, room_for(*first, rank_));
    if (!room) {
        full_ = true;
        end_look();
        return false;
    }
    if (stored) {
        loading_.push_back(*first);
        return false;
    }
    found_.push_back(*first);
    ++rank_;
    return true;
}

// there is nothing to do for a wanted tile
void World::passed()
{
    if (rank_ == done_) {
        ahead_.erase(done_);
        ++done_;
    } else {
        ahead_.insert(rank_);
    }
    ++rank_;
}

void World::end_look()
{
    std::swap(work_, found_);
    found_.clear();
    rank_ = done_;
    if (work_.empty() && splats_ && !foci_.empty())
        splats_->find_bare(); // those whose neighbours turned out to be empty, too
    idle_ = work_.empty();
}

// it is wanted up to a rank, or seen by one that is, or at work
bool World::is_kept(const TileIndex& tile, size_t rank) const
{
    const auto wanted = [&](const TileIndex& t) { return order_.rank_of(t).value_or(rank + 1) <= rank; };
    return wanted(tile) || std::ranges::any_of(tiles_that_see(tile), wanted) || std::ranges::count(found_, tile) > 0;
}

// Drops what is out of reach, farthest first, then what is wanted after `rank`, until a tile fits. false: it does not.
Result<bool> World::room_for(const TileIndex& tile, size_t rank)
{
    if (!request_.host_bytes)
        return true;
    SR_TRY(const WorldTile* own, tiles_->bring(tile));
    uint64_t needed = tiles_->bytes_with_points(*own);
    for (const TileIndex& busy : found_)
        needed += tiles_->bytes_with_points(*tiles_->find(busy));
    if (tiles_->bytes() + needed <= request_.host_bytes)
        return true;
    auto others = nearest_first(tiles_->all(), foci_, edge(), [&](const TileIndex& t) { return !is_kept(t, rank); });
    for (; tiles_->bytes() + needed > request_.host_bytes && !others.empty(); others.pop_back())
        SR_CHECK(drop(others.back()));
    return tiles_->bytes() + needed <= request_.host_bytes;
}

Status World::drop(const TileIndex& tile)
{
    const WorldTile& there = *tiles_->find(tile);
    if (there.stored)
        not_stored_.erase(tile);
    if (there.finished) {
        if (splats_)
            splats_->went(tile);
        ++dropped_;
    }
    if (const auto rank = order_.rank_of(tile))
        ahead_.erase(*rank);
    tiles_->drop(tile);
    return {};
}

// a tile and those beside it, where nothing wanted that is not finished lies beside them, and the store has them
void World::release_around(const TileIndex& tile)
{
    const auto waits = [this](const TileIndex& t) { return order_.rank_of(t).has_value() && !finished(t); };
    const auto release = [&](const TileIndex& t) {
        const WorldTile* there = tiles_->find(t);
        if (!there || (there->finished && !there->stored) || waits(t) || std::ranges::any_of(tiles_around(t), waits))
            return;
        if (there->finished)
            released_.insert(t);
        not_stored_.erase(t);
        tiles_->drop(t);
    };
    release(tile);
    std::ranges::for_each(tiles_around(tile), release);
}

// labels around some of the tiles at work, of which their objects are guessed, are not there yet
Status World::leave_out_work()
{
    for (const TileIndex& tile : work_)
        if (const auto objects = tiles_->objects_near({&tile, 1}); !objects)
            waiting_.insert(tile);
    give_up();
    return {};
}

Status World::cut()
{
    SR_TRY(part_, tiles_->cut(work_));
    auto objects = tiles_->objects_near(work_);
    if (!objects && objects.error().code == kNotYet)
        return leave_out_work();
    SR_CHECK(objects.map([](const auto&) {}));
    SR_CHECK(filling_.cut(part_, request_.settings.regions, *objects));
    SR_CHECK(filling_.load(request_.seed, callbacks_));
    SR_CHECK(filling_.start(nullptr));
    cut_ = true;
    return {};
}

// memory may be short at any allocation: it is called again for the tiles that are left
Status World::finish()
{
    if (scene_ && !request_.targets.empty())
        put_back(scene_->grid, scene_->part, request_.targets);
    if (!scene_) {
        const Status stored = tiles_->finish(work_, part_);
        for (; !work_.empty(); work_.erase(work_.begin())) // they are here, whether or not the store has them
            came(work_.front(), generated_);
        if (!stored && !warned_ && callbacks_.warning)
            callbacks_.warning(fmt::format("finished tiles are not kept: {}", stored.error().message));
        warned_ = warned_ || !stored;
    }
    work_.clear();
    cut_ = filled_ = false;
    return {};
}

// after an error, or where what is being made is not wanted any more
void World::give_up()
{
    if (cut_)
        (void)filling_.cancel(); // what fails then will fail again
    work_.clear();
    found_.clear();
    rank_ = done_;
    cut_ = filled_ = false;
}

// a tile has points. count: of such tiles
void World::came(const TileIndex& tile, uint64_t& count)
{
    if (splats_)
        splats_->came(tile);
    if (const auto rank = order_.rank_of(tile); rank && *rank >= done_)
        ahead_.insert(*rank);
    ++count;
    cells_ += tiles_->find(tile)->cells.cells.size();
}

Status World::check_edits(const LabelEdits& edits) const
{
    for (const auto& [cell, label] : edits) {
        for (const int32_t c : cell)
            if (c < -kMaxCoordinate || c > kMaxCoordinate)
                return fail(ErrorCode::bad_input, "an edit of voxel ({}, {}, {}): beyond 2^20", cell[0], cell[1],
                            cell[2]);
        const uint32_t classes = has_model() ? uint32_t(request_.settings.model.config.num_classes) : kClassCount;
        if (label && *label >= classes)
            return fail(ErrorCode::bad_input, "an edit of voxel ({}, {}, {}): label {}, the model knows {} classes",
                        cell[0], cell[1], cell[2], *label, classes);
    }
    return {};
}

Status World::edit(const LabelEdits& edits)
{
    SR_CHECK(check_edits(edits));
    const std::vector<TileIndex> spoiled = tiles_->edit(edits);
    for (const TileIndex& tile : spoiled) {
        not_stored_.erase(tile); // the store may have it as it was before another edit
        released_.erase(tile);
        if (splats_)
            splats_->edited(tile);
    }
    if (std::ranges::any_of(work_, [&](const TileIndex& t) { return std::ranges::count(spoiled, t) > 0; }))
        give_up();
    look_again();
    return {};
}

void World::labels_ready(const CellWindow& window)
{
    const int32_t reach = 2 * object_block_cells(voxel_size()); // of labels that objects are guessed from
    std::erase_if(waiting_, [&](const TileIndex& tile) {
        const CellWindow around = tile_window(tile, tile_cells(), reach);
        return around.low[0] <= window.high[0] && around.high[0] >= window.low[0] && around.low[1] <= window.high[1] &&
               around.high[1] >= window.low[1];
    });
    look_again();
}

// from the front on
void World::look_again()
{
    loading_.clear();
    found_.clear();
    ahead_.clear();
    done_ = rank_ = 0;
    idle_ = false;
}

Status World::flush()
{
    TileStore* store = tiles_ ? tiles_->store() : nullptr;
    if (!store)
        return {};
    if (releases_) // what wanted tiles see is there, but who goes on after a kill need not have looked at it
        store->name_only([this](const TileIndex& tile) { return order_.rank_of(tile).has_value(); });
    return store->flush();
}

Result<std::unique_ptr<World>> open_world(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels,
                                          const JobCallbacks& callbacks)
{
    SR_ASSERT(labels, "a world needs labels");
    auto world = std::make_unique<World>(device, std::move(request), std::move(labels), callbacks);
    SR_CHECK(world->open());
    return world;
}

} // namespace semrover
