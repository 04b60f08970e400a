// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/tile_regions.h"

#include "engine/voxfield/region_graph.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

namespace semrover {
namespace engine_tile_regions_test {

constexpr int32_t kEdge = 8, kHalo = 5;

RegionOptions options(RegionStrategy strategy = RegionStrategy::rim)
{
    RegionOptions o;
    o.region_size = 24;
    o.coverage_threshold = 8;
    o.strategy = strategy;
    o.tile_cells = kEdge;
    o.halo_cells = kHalo;
    return o;
}

// a ground with walls and holes, tiles -2..3 along i and -1..2 along j
std::vector<Cell> ground()
{
    std::vector<Cell> cells;
    for (int32_t i = -2 * kEdge; i < 4 * kEdge; ++i)
        for (int32_t j = -kEdge; j < 3 * kEdge; ++j)
            for (int32_t k = 0; k < (j % 7 == 3 ? 4 : 1); ++k)
                if ((i * 31 + j * 17) % 11)
                    cells.push_back({i, j, k});
    return cells;
}

// regions as voxels, so that those of different clouds compare
std::vector<std::vector<Cell>> regions_of(const std::vector<Cell>& cells, const TileIndex& tile, const RegionOptions& o)
{
    const auto regions = extract_tile_regions(cells, o);
    EXPECT_TRUE(regions) << regions.error().message;
    std::vector<std::vector<Cell>> found;
    for (size_t r = 0; regions && r < regions->size(); ++r) {
        if (tile_of(cells[regions->seeds[r]], kEdge) != tile)
            continue;
        found.emplace_back();
        for (const uint32_t c : regions->region(r))
            found.back().push_back(cells[c]);
    }
    return found;
}

TEST(engine_tile_regions, a_tile_sees_its_neighbours_of_lower_colours_and_what_these_see_are_neighbours_too)
{
    EXPECT_EQ(tile_colour({-2, 4}), 0);
    EXPECT_EQ(tile_colour({-1, 4}), 1);
    EXPECT_EQ(tile_colour({-2, 3}), 1);
    EXPECT_EQ(tile_colour({-1, -3}), 2);
    const auto near = [](const TileIndex& a, const TileIndex& b) {
        return std::abs(a[0] - b[0]) <= 1 && std::abs(a[1] - b[1]) <= 1;
    };
    for (int32_t x = -2; x < 2; ++x)
        for (int32_t y = -2; y < 2; ++y) {
            const TileIndex tile = {x, y};
            constexpr std::array<size_t, 3> kSeen = {0, 2, 8}; // by colour
            EXPECT_EQ(tiles_seen_by(tile).size(), kSeen[size_t(tile_colour(tile))]);
            EXPECT_EQ(tiles_that_see(tile).size(), kSeen[size_t(2 - tile_colour(tile))]);
            for (const TileIndex& seen : tiles_seen_by(tile)) {
                EXPECT_EQ(std::ranges::count(tiles_that_see(seen), tile), 1);
                for (const TileIndex& far : tiles_seen_by(seen))
                    EXPECT_TRUE(near(far, tile));
            }
        }
}

TEST(engine_tile_regions, every_cell_is_generated_once_by_its_own_tile_and_knows_lower_colours_within_the_halo)
{
    const std::vector<Cell> cells = ground();
    for (const RegionStrategy strategy : {RegionStrategy::rim, RegionStrategy::complete}) {
        const auto regions = extract_tile_regions(cells, options(strategy));
        ASSERT_TRUE(regions) << regions.error().message;
        const RegionGraph graph(*regions, cells.size());
        std::vector<int> generated(cells.size());
        size_t known = 0;
        for (uint32_t r = 0; r < regions->size(); ++r) {
            const TileIndex tile = tile_of(cells[regions->seeds[r]], kEdge);
            for (const uint32_t c : graph.targets(r)) {
                ++generated[c];
                EXPECT_EQ(tile_of(cells[c], kEdge), tile);
            }
            for (const uint32_t c : regions->region(r)) {
                const TileIndex other = tile_of(cells[c], kEdge);
                EXPECT_TRUE(tile_window(tile, kEdge, kHalo).holds(cells[c]));
                EXPECT_TRUE(other == tile || tile_colour(other) < tile_colour(tile));
                known += other != tile;
            }
        }
        EXPECT_EQ(std::ranges::count(generated, 1), int64_t(cells.size()));
        EXPECT_GT(known, cells.size() / 20);
    }
}

TEST(engine_tile_regions, those_of_a_tile_depend_on_its_neighbours_alone)
{
    const std::vector<Cell> cells = ground();
    for (const TileIndex& tile : {TileIndex{0, 0}, {1, 0}, {0, 1}, {1, 1}, {-1, 0}}) {
        std::vector<Cell> near;
        const CellWindow window = tile_window(tile, kEdge, kEdge);
        for (const Cell& cell : cells)
            if (window.holds(cell))
                near.push_back(cell);
        const auto whole = regions_of(cells, tile, options());
        EXPECT_GT(whole.size(), 2u);
        EXPECT_EQ(regions_of(near, tile, options()), whole);
    }
}

TEST(engine_tile_regions, cells_that_are_known_from_the_start_are_nobodys_targets_and_seen_whatever_their_colour)
{
    const std::vector<Cell> cells = ground();
    std::vector<uint8_t> known(cells.size());
    for (size_t c = 0; c < cells.size(); ++c)
        known[c] = tile_of(cells[c], kEdge) != TileIndex{0, 0};
    const auto regions = extract_tile_regions(cells, options(), known);
    ASSERT_TRUE(regions) << regions.error().message;
    const RegionGraph graph(*regions, cells.size(), known);
    std::set<TileIndex> seen;
    size_t targets = 0;
    for (uint32_t r = 0; r < regions->size(); ++r) {
        targets += graph.targets(r).size();
        for (const uint32_t c : regions->region(r))
            seen.insert(tile_of(cells[c], kEdge));
    }
    EXPECT_EQ(int64_t(targets), std::ranges::count(known, 0));
    EXPECT_TRUE(seen.contains({1, 1}) || seen.contains({1, 0}));
}

TEST(engine_tile_regions, refuses_what_leaves_cells_empty_or_reaches_over_a_tile)
{
    const std::vector<Cell> cells = ground();
    const auto message = [&](const RegionOptions& o) {
        const auto regions = extract_tile_regions(cells, o);
        return regions ? std::string() : regions.error().message;
    };
    EXPECT_NE(message(options(RegionStrategy::paper)).find("leaves voxels empty"), std::string::npos);
    RegionOptions narrow = options();
    narrow.tile_cells = 4;
    EXPECT_NE(message(narrow).find("narrower than its halo of 5 voxels"), std::string::npos);
    EXPECT_FALSE(extract_tile_regions({}, options()));
}

} // namespace engine_tile_regions_test
} // namespace semrover
