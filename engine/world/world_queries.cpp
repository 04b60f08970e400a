// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what a world is asked: cells, figures, progress, results, and an estimate of what is left
#include "engine/world/world.h"

#include <algorithm>

namespace semrover {

const VoxelGrid* World::tile(const TileIndex& tile) const
{
    const WorldTile* there = tiles_->find(tile);
    return there && there->finished ? &there->cells : nullptr;
}

VoxelGrid World::cells(const CellWindow& window) const
{
    VoxelGrid out;
    out.voxel_size = voxel_size();
    out.points_per_voxel = points_per_voxel();
    for (const TileIndex& index : tiles_in(tiles_->all(), window, tile_cells()))
        if (const VoxelGrid* there = tile(index))
            for (size_t c = 0; c < there->cells.size(); ++c)
                if (window.holds(there->cells[c]))
                    append_cell(out, *there, c);
    sort_cells(out);
    return out;
}

WorldFigures World::figures() const
{
    WorldFigures f{.wanted = order_.size(), .in_memory = tiles_->all().size(), .host_bytes = tiles_->bytes()};
    const auto passed = [this](const TileIndex& tile) {
        const auto rank = order_.rank_of(tile);
        return rank && (*rank < done_ || ahead_.contains(*rank));
    };
    f.finished = done_ + ahead_.size() - size_t(std::ranges::count_if(waiting_, passed));
    f.generated = generated_;
    f.loaded = loaded_;
    f.dropped = dropped_;
    f.full = full_ || (splats_ && splats_->full());
    return f;
}

void World::say(bool ended) const
{
    if (!callbacks_.progress)
        return;
    if (scene_)
        return filling_.say(callbacks_, ended);
    JobProgress p{.stage = "generate", .unit = "tiles"};
    p.done = done_ + ahead_.size();
    p.total = order_.size();
    p.device_bytes = ended ? 0 : filling_.device().allocated_bytes();
    p.ended = ended;
    callbacks_.progress(p);
}

Json World::results() const
{
    if (scene_)
        return filling_.results();
    return {{"cells", cells_},
            {"tiles", generated_ + loaded_},
            {"planned_device_bytes", planned_bytes_},
            {"peak_device_bytes", filling_.device().peak_bytes()}};
}

Result<Json> World::estimate(size_t runs)
{
    SR_TRY(Json report, filling_.estimate(runs)); // in the order of tiles of the region that open() began
    if (scene_)
        return report;
    size_t cells = 0, regions = 0, tiles = 0;
    const size_t most = size_t(most_targets(request_.settings.regions));
    for (size_t rank = 0; const auto index = order_.at(rank); ++rank) {
        SR_TRY(const WorldTile* tile, tiles_->bring(*index));
        if (!tile || tile->finished)
            continue;
        const auto known = std::ranges::count_if(tile->known, [](uint8_t k) { return k != 0; });
        const size_t missing = tile->cells.cells.size() - size_t(known);
        cells += missing;
        regions += (missing + most - 1) / most;
        ++tiles;
        tiles_->drop(*index);
    }
    const double seconds = report["seconds"].get<double>() / report["regions"].get<double>();
    report.update({{"tiles", tiles},
                   {"cells", cells},
                   {"regions", regions},
                   {"seconds", seconds * double(regions)},
                   {"peak_device_bytes", planned_bytes_}});
    return report;
}

} // namespace semrover
