// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/job/world.h"

#include "engine/job/grid_filling.h"
#include "engine/job/world_tiles.h"
#include "engine/scene/cell_reach.h"
#include "engine/scene/palette.h"
#include "runtime/base/hash.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kMostRadius = 2000;         // metres; some 140,000 tiles
constexpr int32_t kFarthestCell = 1 << 19;   // of a focus
constexpr uint64_t kNoDeadline = 1ull << 60; // microseconds

// pieces of work, which take different times
enum class Piece : uint8_t { look, load, cut, first_row, row, last_row, finish, splats };
constexpr size_t kPieces = 8;

class StreamedWorld : public World {
  public:
    StreamedWorld(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels,
                  const JobCallbacks& callbacks)
        : request_(std::move(request)), callbacks_(callbacks), labels_(std::move(labels)),
          filling_(device, request_.settings, request_.transformer)
    {
    }
    ~StreamedWorld() override { (void)filling_.cancel(); }

    Status open();
    Status focus(const WorldFocus& focus) override;
    Result<bool> step(const JobBudget& budget) override;
    Status edit(const LabelEdits& edits) override;
    const VoxelGrid* tile(const TileIndex& tile) const override;
    std::vector<TileIndex> tiles_with_points() const override;
    int32_t tile_cells() const override { return request_.settings.regions.tile_cells; }
    WorldFigures figures() const override;
    const SplatPool* splats() const override { return splats_.get(); }
    Status flush() override { return tiles_->drain(); }

  private:
    float voxel_size() const { return request_.settings.model.config.voxel_size; }
    bool finished(const TileIndex& tile) const
    {
        const auto there = tiles_->all().find(tile);
        return there != tiles_->all().end() && there->second.finished;
    }
    Status warm_up();
    Status do_piece(Piece piece, bool waits);
    Piece next_piece() const;
    Status look();
    Result<std::optional<TileIndex>> missing(const TileIndex& tile);
    Result<bool> room_for(const TileIndex& wanted, size_t rank);
    Status drop(const TileIndex& tile);
    Status cut();
    Status fill(bool waits);
    Status finish();
    uint32_t detail(const TileIndex& tile) const
    {
        return detail_of(distance_to_tile(focus_, tile, tile_cells(), voxel_size()), request_.detail_distance);
    }
    bool has_splats(const TileIndex& tile) const { return splats_->has(tile) && details_.at(tile) == detail(tile); }
    void find_bare();
    Result<SurfelScene> splats_of(const VoxelGrid& cells, uint32_t detail);
    Result<bool> add_splats(const TileIndex& tile, const SurfelScene& surfels);
    Status make_splats(const TileIndex& tile);
    Status drop_splats(const TileIndex& tile);
    void give_up();
    void came(const TileIndex& tile);
    Status went(const TileIndex& tile);

    const WorldRequest request_;
    const JobCallbacks callbacks_;
    std::unique_ptr<WorldLabels> labels_;
    std::unique_ptr<WorldTiles> tiles_;
    GridFilling filling_;
    WorldFocus focus_;
    std::vector<TileIndex> wanted_; // first in front
    size_t done_ = 0;               // of wanted_, from the front on
    uint32_t at_once_ = 1;
    bool idle_ = true, full_ = false;
    std::vector<TileIndex> loading_;    // taken from the cache next
    std::set<TileIndex> not_stored_;    // the cache does not have them
    std::vector<TileIndex> work_;       // tiles that are being generated
    bool cut_ = false, filled_ = false; // how far they are
    VoxelGrid part_;                    // they, and what they know
    std::unique_ptr<SplatPool> splats_;
    std::vector<TileIndex> bare_;           // finished tiles whose splats are made next
    std::map<TileIndex, uint32_t> details_; // that the splats of tiles were made for
    std::array<SubmitCost, kPieces> costs_;
    uint64_t generated_ = 0, loaded_ = 0, dropped_ = 0;
};

// names model, settings and seed: what the keys of tiles are made of beside labels and objects
Status StreamedWorld::open()
{
    const GenerationSettings& s = request_.settings;
    if (!s.regions.tile_cells)
        return fail(ErrorCode::usage, "a world is generated in the order of tiles: its settings need a tile size");
    SR_CHECK(check_tile_options(s.regions));
    if (!(request_.detail_distance >= 0 && std::isfinite(request_.detail_distance)))
        return fail(ErrorCode::usage, "a detail distance of {} m", request_.detail_distance);
    if (std::abs(labels_->voxel_size() - voxel_size()) > 1e-4f * voxel_size())
        return fail(ErrorCode::bad_input, "the labels have cells of {} m, the model was trained on {} m",
                    labels_->voxel_size(), voxel_size());
    SR_TRY(const Json settings, settings_json(s, filling_.device(), "world", 0));
    Hash base;
    base.add(settings.dump());
    base.add(std::as_bytes(std::span(&request_.seed, 1)));
    SR_TRY(WorldObjects objects, WorldObjects::create(s.model, request_.objects, request_.seed));
    SR_TRY(tiles_, WorldTiles::create(s, *labels_, std::move(objects), request_.cache, base.value()));
    at_once_ = request_.tiles_at_once;
    if (!at_once_) // a GPU wants more regions at once than one tile has ready; not measured
        at_once_ = filling_.device().limits().type == DeviceType::cpu ? 1 : 4;
    return warm_up();
}

// the first step of a region as large as regions get
Status StreamedWorld::warm_up()
{
    RegionOptions options = request_.settings.regions;
    options.tile_cells = 0;
    VoxelGrid grid;
    grid.voxel_size = voxel_size();
    for (int32_t i = 0; i < options.region_size; ++i)
        grid.cells.push_back({i / 16, i % 16, 0});
    grid.labels.assign(grid.cells.size(), 0);
    SR_CHECK(filling_.cut(grid, options));
    SR_CHECK(filling_.load(request_.seed, callbacks_));
    SR_CHECK(filling_.start(nullptr));
    SR_CHECK(filling_.step({.submits = 2, .microseconds = kNoDeadline}).map([](bool) {}));
    SR_CHECK(filling_.cancel());
    if (!request_.splat_bytes)
        return {};
    SR_TRY(splats_, SplatPool::create(filling_.device(), request_.splat_bytes));
    grid.generated.assign(grid.cells.size(), 1); // points in the middle of their cells
    return SurfelScene::create(filling_.device(), points_of(grid), request_.surfels).map([](const auto&) {});
}

Status StreamedWorld::focus(const WorldFocus& focus)
{
    bool finite = std::isfinite(focus.radius);
    for (size_t a = 0; a < 3; ++a)
        finite = finite && std::isfinite(focus.position[a]) && std::isfinite(focus.direction[a]);
    if (!finite || focus.radius < 0 || focus.radius > kMostRadius)
        return fail(ErrorCode::usage, "a focus: expected finite numbers and a radius of 0 to {} m, found {} m",
                    kMostRadius, focus.radius);
    for (size_t a = 0; a < 2; ++a)
        if (std::abs(focus.position[a]) > kFarthestCell * double(voxel_size()))
            return fail(ErrorCode::usage, "a focus at {} m is too far out", focus.position[a]);
    focus_ = focus;
    wanted_ = tiles_in_order(focus, tile_cells(), voxel_size());
    done_ = 0;
    idle_ = full_ = false;
    loading_.clear();
    find_bare();
    const double reach = focus.radius + 2 * tile_cells() * double(voxel_size());
    const Cell low = cell_at({focus.position[0] - reach, focus.position[1] - reach, 0}, voxel_size());
    const Cell high = cell_at({focus.position[0] + reach, focus.position[1] + reach, 0}, voxel_size());
    tiles_->keep_objects_near({{low[0], low[1]}, {high[0], high[1]}});
    return {};
}

// tiles that get fewer splats first: they make room for the others
void StreamedWorld::find_bare()
{
    bare_.clear();
    for (const TileIndex& tile : wanted_)
        if (splats_ && this->tile(tile) && !has_splats(tile))
            bare_.push_back(tile);
    std::ranges::stable_partition(bare_,
                                  [this](const TileIndex& t) { return splats_->has(t) && details_.at(t) < detail(t); });
}

Piece StreamedWorld::next_piece() const
{
    if (!bare_.empty())
        return Piece::splats;
    if (work_.empty())
        return loading_.empty() ? Piece::look : Piece::load;
    if (!cut_)
        return Piece::cut;
    if (filled_)
        return Piece::finish;
    return filling_.begins_batch() ? Piece::first_row : filling_.ends_batch() ? Piece::last_row : Piece::row;
}

Result<bool> StreamedWorld::step(const JobBudget& budget)
{
    BudgetMeter meter(budget);
    bool spent = false; // something was done already
    while (!idle_ || !work_.empty() || !bare_.empty()) {
        const Piece piece = next_piece();
        SubmitCost& cost = costs_[size_t(piece)];
        if (spent && !meter.room_for(cost.bound()))
            return false;
        if (const Status status = do_piece(piece, budget.timed()); !status) {
            give_up();
            return tl::make_unexpected(status.error());
        }
        meter.spent(cost, piece == Piece::first_row || piece == Piece::row || piece == Piece::last_row);
        spent = true;
    }
    return true;
}

Status StreamedWorld::do_piece(Piece piece, bool waits)
{
    switch (piece) {
    case Piece::look:
        return look();
    case Piece::load: {
        const TileIndex tile = loading_.back();
        loading_.pop_back();
        SR_TRY(const bool there, tiles_->load(tile));
        if (!there) {
            not_stored_.insert(tile);
            return {};
        }
        ++loaded_;
        came(tile);
        return {};
    }
    case Piece::splats: {
        const TileIndex tile = bare_.front();
        bare_.erase(bare_.begin());
        return make_splats(tile);
    }
    case Piece::cut:
        return cut();
    case Piece::finish:
        return finish();
    case Piece::first_row:
    case Piece::row:
    case Piece::last_row:
        break;
    }
    return fill(waits);
}

// the first tile that is not finished among `tile` and those that it sees, lower colours first
Result<std::optional<TileIndex>> StreamedWorld::missing(const TileIndex& tile)
{
    SR_TRY(const WorldTile* own, tiles_->bring(tile));
    if (own->finished)
        return std::optional<TileIndex>();
    if (!request_.cache.empty() && !not_stored_.contains(tile))
        return std::optional(tile); // the cache may have it
    for (const TileIndex& seen : tiles_seen_by(tile)) {
        SR_TRY(const auto first, missing(seen));
        if (first)
            return first;
    }
    return std::optional(tile);
}

// finds what to do next: a tile of the cache, or tiles of one colour that wait for none
Status StreamedWorld::look()
{
    while (done_ < wanted_.size() && finished(wanted_[done_]))
        ++done_;
    for (size_t rank = done_; rank < wanted_.size(); ++rank) {
        SR_TRY(const auto first, missing(wanted_[rank]));
        if (!first || std::ranges::count(work_, *first))
            continue;
        const bool stored = !request_.cache.empty() && !not_stored_.contains(*first);
        if (!work_.empty() && (stored || tile_colour(*first) != tile_colour(work_[0])))
            continue;
        SR_TRY(const bool room, room_for(*first, rank));
        if (!room) {
            full_ = true;
            break;
        }
        if (stored) {
            loading_.push_back(*first);
            return {};
        }
        work_.push_back(*first);
        if (work_.size() >= at_once_)
            return {};
        if (rank >= done_ + 4 * at_once_) // what is far would come before what is near
            break;
    }
    idle_ = work_.empty();
    return {};
}

// Drops what is out of reach, farthest first, then what is wanted after `rank`, until a tile fits. false: it does not.
Result<bool> StreamedWorld::room_for(const TileIndex& tile, size_t rank)
{
    if (!request_.host_bytes)
        return true;
    std::set<TileIndex> kept(wanted_.begin(), wanted_.begin() + ptrdiff_t(rank) + 1);
    for (const TileIndex& wanted : std::vector<TileIndex>(kept.begin(), kept.end()))
        for (const TileIndex& seen : tiles_seen_by(wanted))
            kept.insert(seen);
    for (const TileIndex& busy : work_)
        kept.insert(busy);
    SR_TRY(const WorldTile* own, tiles_->bring(tile));
    uint64_t needed = tiles_->bytes_with_points(*own);
    for (const TileIndex& busy : work_)
        needed += tiles_->bytes_with_points(tiles_->all().at(busy));
    std::vector<std::pair<double, TileIndex>> others;
    for (const auto& [index, there] : tiles_->all())
        if (!kept.contains(index))
            others.emplace_back(distance_to_tile(focus_, index, tile_cells(), voxel_size()), index);
    std::ranges::sort(others);
    for (; tiles_->bytes() + needed > request_.host_bytes && !others.empty(); others.pop_back())
        SR_CHECK(drop(others.back().second));
    return tiles_->bytes() + needed <= request_.host_bytes;
}

Status StreamedWorld::drop(const TileIndex& tile)
{
    const WorldTile& there = tiles_->all().at(tile);
    if (there.stored)
        not_stored_.erase(tile);
    if (there.finished && !there.cells.cells.empty()) {
        ++dropped_;
        SR_CHECK(went(tile));
    }
    tiles_->drop(tile);
    return {};
}

Status StreamedWorld::cut()
{
    SR_TRY(part_, tiles_->cut(work_));
    SR_TRY(const std::vector<SceneObject> objects, tiles_->objects_near(work_));
    SR_CHECK(filling_.cut(part_, request_.settings.regions, objects));
    SR_CHECK(filling_.load(request_.seed, callbacks_));
    SR_CHECK(filling_.start(nullptr));
    cut_ = true;
    return {};
}

Status StreamedWorld::fill(bool waits)
{
    SR_TRY(filled_, filling_.step({.submits = 1, .microseconds = waits ? kNoDeadline : ~0ull}));
    return {};
}

Status StreamedWorld::finish()
{
    const Status stored = tiles_->finish(work_, part_);
    for (const TileIndex& tile : work_) { // they are here, whether or not the cache has them
        ++generated_;
        came(tile);
    }
    work_.clear();
    cut_ = filled_ = false;
    return stored;
}

// after an error, or where what is being made is not wanted any more
void StreamedWorld::give_up()
{
    if (cut_)
        (void)filling_.cancel(); // what fails then will fail again
    work_.clear();
    cut_ = filled_ = false;
}

void StreamedWorld::came(const TileIndex& tile)
{
    if (splats_)
        bare_.push_back(tile);
}

Status StreamedWorld::went(const TileIndex& tile)
{
    std::erase(bare_, tile);
    return splats_ ? drop_splats(tile) : Status();
}

Status StreamedWorld::drop_splats(const TileIndex& tile)
{
    details_.erase(tile);
    return splats_->remove(tile);
}

Result<SurfelScene> StreamedWorld::splats_of(const VoxelGrid& cells, uint32_t detail)
{
    const ScenePoints points = points_of(cells);
    if (!detail)
        return SurfelScene::create(filling_.device(), points, request_.surfels);
    const float edge = std::ldexp(voxel_size(), int(detail) - 2); // half a cell, a cell, two cells
    SurfelOptions options = request_.surfels;
    options.auto_sigma = true; // they stand for larger pieces
    options.largest_sigma = 2 * edge;
    options.neighbor_radius = std::max(options.neighbor_radius, 3 * edge);
    return SurfelScene::create(filling_.device(), thinned(points, edge), options);
}

// those out of reach make room, farthest first; false: there is none
Result<bool> StreamedWorld::add_splats(const TileIndex& index, const SurfelScene& surfels)
{
    details_.erase(index);
    SR_TRY(bool there, splats_->add(index, surfels));
    std::vector<std::pair<double, TileIndex>> others;
    for (const auto& [other, place] : splats_->places())
        if (const double away = distance_to_tile(focus_, other, tile_cells(), voxel_size()); away > focus_.radius)
            others.emplace_back(away, other);
    std::ranges::sort(others);
    for (; !there && !others.empty(); others.pop_back()) {
        SR_CHECK(drop_splats(others.back().second));
        SR_TRY(there, splats_->add(index, surfels));
    }
    return there;
}

// One that is dropped meanwhile has none. Where there is no room, coarser ones may fit.
Status StreamedWorld::make_splats(const TileIndex& index)
{
    const VoxelGrid* cells = tile(index);
    if (!cells || has_splats(index))
        return {};
    const uint32_t wanted = detail(index), coarsest = request_.detail_distance > 0 ? kCoarsestDetail : 0;
    bool there = false;
    for (uint32_t detail = wanted; !there && detail <= coarsest; ++detail) {
        SR_TRY(const SurfelScene surfels, splats_of(*cells, detail));
        SR_TRY(there, add_splats(index, surfels));
        full_ = full_ || !there;
    }
    if (there)
        details_[index] = wanted;
    return {};
}

Status StreamedWorld::edit(const LabelEdits& edits)
{
    for (const auto& [cell, label] : edits) {
        for (const int32_t c : cell)
            if (c < -kMaxCoordinate || c > kMaxCoordinate)
                return fail(ErrorCode::bad_input, "an edit of cell ({}, {}, {}): beyond 2^20", cell[0], cell[1],
                            cell[2]);
        if (label && *label >= request_.settings.model.config.num_classes)
            return fail(ErrorCode::bad_input, "an edit of cell ({}, {}, {}): label {}, the model knows {} classes",
                        cell[0], cell[1], cell[2], *label, request_.settings.model.config.num_classes);
    }
    std::set<TileIndex> before;
    for (const auto& [index, there] : tiles_->all())
        if (there.finished && !there.cells.cells.empty())
            before.insert(index);
    SR_TRY(const std::vector<TileIndex> spoiled, tiles_->edit(edits));
    for (const TileIndex& tile : spoiled) {
        not_stored_.erase(tile); // the cache may have it as it was before another edit
        if (before.contains(tile))
            SR_CHECK(went(tile));
    }
    if (std::ranges::any_of(work_, [&](const TileIndex& t) { return std::ranges::count(spoiled, t) > 0; }))
        give_up();
    loading_.clear();
    done_ = 0;
    idle_ = false;
    return {};
}

const VoxelGrid* StreamedWorld::tile(const TileIndex& tile) const
{
    const auto there = tiles_->all().find(tile);
    const bool has_points = there != tiles_->all().end() && there->second.finished && there->second.cells.has_points();
    return has_points ? &there->second.cells : nullptr;
}

std::vector<TileIndex> StreamedWorld::tiles_with_points() const
{
    std::vector<TileIndex> tiles;
    for (const auto& [index, there] : tiles_->all())
        if (tile(index))
            tiles.push_back(index);
    return tiles;
}

WorldFigures StreamedWorld::figures() const
{
    WorldFigures f{.wanted = wanted_.size(), .in_memory = tiles_->all().size(), .host_bytes = tiles_->bytes()};
    f.finished = size_t(std::ranges::count_if(wanted_, [this](const TileIndex& t) { return finished(t); }));
    f.generated = generated_;
    f.loaded = loaded_;
    f.dropped = dropped_;
    f.full = full_;
    return f;
}

} // namespace

Result<std::unique_ptr<World>> open_world(Device& device, WorldRequest request, std::unique_ptr<WorldLabels> labels,
                                          const JobCallbacks& callbacks)
{
    SR_ASSERT(labels, "a world needs labels");
    auto world = std::make_unique<StreamedWorld>(device, std::move(request), std::move(labels), callbacks);
    SR_CHECK(world->open());
    return world;
}

} // namespace semrover
