// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/world/world_splats.h"

#include "engine/conditioning/cell_objects.h"
#include "engine/scene/cell_number.h"

#include <cmath>

namespace semrover {

namespace {

// the voxels that may have points within a margin in metres around a tile
VoxelGrid near_tile(const VoxelGrid& cells, const TileIndex& tile, double edge, double margin)
{
    VoxelGrid near;
    near.voxel_size = cells.voxel_size;
    near.points_per_voxel = cells.points_per_voxel;
    const auto reaches = [&](const Cell& cell) {
        for (size_t a = 0; a < 2; ++a) {
            const double low = (cell[a] - 1) * double(cells.voxel_size),
                         high = (cell[a] + 2) * double(cells.voxel_size);
            if (high < tile[a] * edge - margin || low > (tile[a] + 1) * edge + margin)
                return false;
        }
        return true;
    };
    for (size_t i = 0; i < cells.cells.size(); ++i)
        if (reaches(cells.cells[i]))
            append_cell(near, cells, i);
    return near;
}

} // namespace

Result<std::unique_ptr<WorldSplats>> WorldSplats::create(Device& device, const WorldTiles& tiles,
                                                         const WorldSplatOptions& options)
{
    std::unique_ptr<WorldSplats> s(new WorldSplats(tiles, options));
    SR_TRY(s->pool_, SplatPool::create(device, options.bytes));
    return s;
}

const VoxelGrid* WorldSplats::finished(const TileIndex& tile) const
{
    const WorldTile* there = tiles_.find(tile);
    return there && there->finished ? &there->cells : nullptr;
}

uint32_t WorldSplats::detail(const TileIndex& tile) const
{
    return detail_of(distance_to_tile(foci_, tile, options_.edge), options_.detail_distance);
}

void WorldSplats::want(const WorldFoci& foci)
{
    foci_ = foci;
    full_ = false;
    if (!foci.empty())
        find_bare();
}

void WorldSplats::went(const TileIndex& tile)
{
    std::erase(bare_, tile);
    drop(tile);
}

void WorldSplats::edited(const TileIndex& tile)
{
    std::erase(bare_, tile);
    if (pool_->has(tile))
        stale_.insert(tile);
}

// tiles that get fewer splats first: they make room for the others
void WorldSplats::find_bare()
{
    bare_ = nearest_first(tiles_.all(), foci_, options_.edge, [this](const TileIndex& t) {
        return !out_of_reach(foci_, t, options_.edge) && finished(t) && !has_splats(t);
    });
    std::ranges::stable_partition(bare_, [this](const TileIndex& t) {
        const auto made = made_for_.find(t);
        return made != made_for_.end() && made->second.detail < detail(t);
    });
}

// those beside it have not had these points for neighbours
void WorldSplats::came(const TileIndex& tile)
{
    bare_.push_back(tile);
    int bit = 8; // of this tile for the other
    for (const TileIndex& other : tiles_around(tile)) {
        --bit;
        const auto made = made_for_.find(other);
        if (made == made_for_.end())
            continue;
        made->second.neighbours &= uint8_t(~(1u << bit));
        if (!has_splats(other) && !std::ranges::count(bare_, other))
            bare_.push_back(other);
    }
}

void WorldSplats::drop(const TileIndex& tile)
{
    pool_->remove(tile); // may fail for lack of memory, and then nothing has changed
    stale_.erase(tile);
    made_for_.erase(tile);
}

// as it is to be now. One whose neighbours are still to come is not made anew for each of them
bool WorldSplats::has_splats(const TileIndex& tile) const
{
    const auto made = made_for_.find(tile);
    if (made == made_for_.end() || stale_.contains(tile) || made->second.detail != detail(tile))
        return false;
    return !(neighbours_with_points(tile) & ~made->second.neighbours) || !neighbours_are_settled(tile);
}

// a bit for each of tiles_around()
uint8_t WorldSplats::neighbours_with_points(const TileIndex& tile) const
{
    uint8_t bits = 0;
    int n = 0;
    for (const TileIndex& other : tiles_around(tile))
        bits |= uint8_t((finished(other) != nullptr) << n++);
    return bits;
}

bool WorldSplats::neighbours_are_settled(const TileIndex& tile) const
{
    return std::ranges::all_of(tiles_around(tile), [this](const TileIndex& t) {
        return finished(t) || tiles_.is_empty(t) || out_of_reach(foci_, t, options_.edge);
    });
}

// Points of other tiles that may be neighbours of a tile's own, which lie up to a voxel outside of it. thinned_by: the
// edge of cubes, metres; 0: they are not thinned
void WorldSplats::append_neighbours(const TileIndex& tile, float reach, float thinned_by, ScenePoints& points) const
{
    const double margin = reach + options_.voxel_size;
    for (const TileIndex& index : tiles_around(tile)) {
        const VoxelGrid* cells = finished(index);
        if (!cells)
            continue;
        // a cube at the border is thinned whole
        const VoxelGrid border = near_tile(*cells, tile, options_.edge, margin + 2 * thinned_by);
        const ScenePoints all = thinned_by > 0 ? thinned(points_of(border), thinned_by) : points_of(border);
        for (size_t i = 0; i < all.size(); ++i) {
            bool near = true;
            for (size_t a = 0; a < 2; ++a)
                near = near && all.positions[i][a] > tile[a] * options_.edge - margin &&
                       all.positions[i][a] < (tile[a] + 1) * options_.edge + margin;
            if (!near)
                continue;
            points.positions.push_back(all.positions[i]);
            points.colors.push_back(all.colors[i]);
            points.labels.push_back(all.labels[i]);
            points.cells.push_back(0);
            if (!options_.objects.empty())
                points.owners.push_back(0);
        }
    }
}

// those out of reach make room, farthest first
Result<SplatPool::Room> WorldSplats::add(const TileIndex& index, const VoxelGrid& cells, uint32_t detail)
{
    ScenePoints points = points_of(cells);
    if (!options_.objects.empty()) {
        SR_TRY(points.owners, instances_of_points(cells, options_.objects));
    }
    PointSplatOptions options = options_.points;
    const float cube =
        detail ? std::ldexp(options_.voxel_size, int(detail) - 2) : 0; // half a voxel, a voxel, two voxels
    if (detail) {
        points = thinned(points, cube);
        options.auto_sigma = true; // they stand for larger pieces
        options.largest_sigma = 2 * cube;
        options.neighbor_radius = std::max(options.neighbor_radius, 3 * cube);
    }
    const size_t own = points.size();
    for (uint32_t& cell : points.cells)
        cell = cell_number(cells.cells[cell]);
    append_neighbours(index, options.neighbor_radius, cube, points);
    SR_TRY(SplatPool::Room room, pool_->add(index, points, own, options));
    if (room != SplatPool::Room::none)
        return room;
    auto others = nearest_first(pool_->places(), foci_, options_.edge,
                                [this](const TileIndex& t) { return out_of_reach(foci_, t, options_.edge); });
    for (; room == SplatPool::Room::none && !others.empty(); others.pop_back()) {
        drop(others.back());
        SR_TRY(room, pool_->add(index, points, own, options));
    }
    return room;
}

// One that is dropped meanwhile has none. Where there is no room, coarser ones may fit. It stays the next one until it
// has them: what fails is tried again.
Status WorldSplats::make_next()
{
    const TileIndex index = bare_.front();
    const VoxelGrid* cells = finished(index);
    if (!cells || has_splats(index)) {
        bare_.erase(bare_.begin());
        return {};
    }
    const uint32_t wanted = detail(index), coarsest = options_.detail_distance > 0 ? kCoarsestDetail : 0;
    std::map<TileIndex, MadeFor> made{{index, {wanted, neighbours_with_points(index)}}}; // it may not fail afterwards
    SplatPool::Room room = SplatPool::Room::none;
    for (uint32_t detail = wanted; room == SplatPool::Room::none && detail <= coarsest; ++detail) {
        SR_TRY(room, add(index, *cells, detail));
        full_ = full_ || room != SplatPool::Room::found;
    }
    if (room == SplatPool::Room::later) { // in another step, when what leaves has left
        no_room_yet_ = true;
        return {};
    }
    if (room == SplatPool::Room::found) {
        made_for_.erase(index);
        made_for_.merge(made);
    }
    stale_.erase(index);
    bare_.erase(bare_.begin());
    return {};
}

uint32_t detail_of(double away, double detail_distance)
{
    uint32_t detail = 0;
    for (double reach = detail_distance; reach > 0 && away > reach && detail < kCoarsestDetail; reach *= 2)
        ++detail;
    return detail;
}

} // namespace semrover
