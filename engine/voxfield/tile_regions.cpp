// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/tile_regions.h"

#include <algorithm>

namespace semrover {

namespace {

std::vector<TileIndex> neighbors(const TileIndex& tile)
{
    std::vector<TileIndex> around;
    for (int32_t x = -1; x <= 1; ++x)
        for (int32_t y = -1; y <= 1; ++y)
            if (x || y)
                around.push_back({tile[0] + x, tile[1] + y});
    return around;
}

class TileCover {
  public:
    TileCover(std::span<const Cell> cells, const RegionOptions& options, std::span<const uint8_t> known)
        : cells_(cells), options_(options), known_(known)
    {
        for (uint32_t c = 0; c < cells.size(); ++c)
            tiles_[tile_of(cells[c], options.tile_cells)].push_back(c);
        regions_.offsets.push_back(0);
    }

    Result<Regions> run()
    {
        for (int colour = 0; colour < kTileColours; ++colour)
            for (const auto& [tile, cells] : tiles_)
                if (tile_colour(tile) == colour)
                    SR_CHECK(cover(tile, cells));
        return std::move(regions_);
    }

  private:
    bool is_known(uint32_t cell) const { return !known_.empty() && known_[cell]; }

    // voxels that the tile's regions may have: its own, and the known ones within the halo
    std::vector<uint32_t> considered(const TileIndex& tile, const std::vector<uint32_t>& own) const
    {
        std::vector<uint32_t> all = own;
        const CellWindow window = tile_window(tile, options_.tile_cells, options_.halo_cells);
        for (const TileIndex& other : neighbors(tile)) {
            const auto entry = tiles_.find(other);
            if (entry == tiles_.end())
                continue;
            const bool seen = tile_colour(other) < tile_colour(tile);
            for (const uint32_t c : entry->second)
                if ((seen || is_known(c)) && window.holds(cells_[c]))
                    all.push_back(c);
        }
        std::ranges::sort(all);
        return all;
    }

    Status cover(const TileIndex& tile, const std::vector<uint32_t>& own)
    {
        if (std::ranges::all_of(own, [this](uint32_t c) { return is_known(c); }))
            return {};
        const std::vector<uint32_t> all = considered(tile, own);
        std::vector<Cell> cells;
        std::vector<uint8_t> known;
        for (const uint32_t c : all) {
            cells.push_back(cells_[c]);
            known.push_back(is_known(c) || tile_of(cells_[c], options_.tile_cells) != tile);
        }
        RegionOptions options = options_;
        options.from_known = true;
        options.first_cell = 0;
        SR_TRY(const Regions found, extract_regions(cells, options, known));
        for (size_t r = 0; r < found.size(); ++r) {
            for (const uint32_t member : found.region(r))
                regions_.members.push_back(all[member]);
            if (regions_.members.size() > UINT32_MAX)
                return fail(ErrorCode::bad_input, "regions of {} voxels need more than 32-bit offsets: split the scene",
                            cells_.size());
            regions_.offsets.push_back(uint32_t(regions_.members.size()));
            regions_.seeds.push_back(all[found.seeds[r]]);
        }
        return {};
    }

    std::span<const Cell> cells_;
    const RegionOptions options_;
    std::span<const uint8_t> known_;
    std::map<TileIndex, std::vector<uint32_t>> tiles_;
    Regions regions_;
};

} // namespace

int tile_colour(const TileIndex& tile)
{
    return (tile[0] & 1) + (tile[1] & 1);
}

std::vector<TileIndex> tiles_that_see(const TileIndex& tile)
{
    std::vector<TileIndex> tiles = neighbors(tile);
    std::erase_if(tiles, [&](const TileIndex& other) { return tile_colour(other) <= tile_colour(tile); });
    return tiles;
}

std::vector<TileIndex> tiles_seen_by(const TileIndex& tile)
{
    std::vector<TileIndex> tiles = neighbors(tile);
    std::erase_if(tiles, [&](const TileIndex& other) { return tile_colour(other) >= tile_colour(tile); });
    std::ranges::stable_sort(tiles, {}, tile_colour);
    return tiles;
}

Status check_tile_options(const RegionOptions& options)
{
    if (options.strategy == RegionStrategy::paper)
        return fail(ErrorCode::usage, "strategy paper leaves voxels empty: the order of tiles takes rim or complete");
    if (options.tile_cells < std::max(options.halo_cells, 1))
        return fail(ErrorCode::usage, "a tile of {} voxels is narrower than its halo of {} voxels", options.tile_cells,
                    options.halo_cells);
    return {};
}

Result<Regions> extract_tile_regions(std::span<const Cell> cells, const RegionOptions& options,
                                     std::span<const uint8_t> known)
{
    SR_ASSERT(known.empty() || known.size() == cells.size(), "{} flags for {} voxels", known.size(), cells.size());
    SR_ASSERT(std::ranges::is_sorted(cells), "voxels of tiles are in order");
    SR_CHECK(check_tile_options(options));
    if (cells.empty())
        return fail(ErrorCode::bad_input, "the cloud has no voxels");
    return TileCover(cells, options, known).run();
}

} // namespace semrover
