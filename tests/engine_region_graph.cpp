// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/region_graph.h"

#include <algorithm>
#include <chrono>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_region_graph_test {

// regions given by their members
Regions make_regions(const std::vector<std::vector<uint32_t>>& rows)
{
    Regions regions;
    regions.offsets.push_back(0);
    for (const auto& row : rows) {
        regions.members.insert(regions.members.end(), row.begin(), row.end());
        regions.offsets.push_back(uint32_t(regions.members.size()));
        regions.seeds.push_back(row.front());
    }
    return regions;
}

std::vector<std::array<int32_t, 3>> plane(int side)
{
    std::vector<std::array<int32_t, 3>> cells;
    for (int x = 0; x < side; ++x)
        for (int y = 0; y < side; ++y)
            cells.push_back({x, y, (x / 5 + y / 7) % 3});
    return cells;
}

std::vector<uint32_t> list(std::span<const uint32_t> values)
{
    return {values.begin(), values.end()};
}

using List = std::vector<uint32_t>;

TEST(RegionGraph, ARegionThatIsGivenBackIsReadyAgain)
{
    RegionGraph graph(make_regions({{0, 1}, {2, 3}, {4, 5}, {1, 6}}), 7);
    EXPECT_EQ(graph.take(2), (List{0, 1}));
    graph.give_back(0);
    EXPECT_EQ(graph.take(8), (List{0, 2}));
    graph.done(0);
    EXPECT_EQ(graph.take(8), (List{3}));
}

TEST(RegionGraph, ARegionWaitsForThoseWhoseTargetsItKnows)
{
    // 2 knows voxels of 0 and of 1; 3 shares with 2 only a voxel both know, so it waits for 1 alone; 4 adds nothing
    RegionGraph graph(make_regions({{0, 1, 2}, {3, 4}, {1, 3, 5}, {3, 6}, {0, 5, 6}}), 8);
    EXPECT_EQ(graph.region_count(), 4u);
    EXPECT_EQ(list(graph.targets(2)), (List{5}));
    EXPECT_EQ(list(graph.waits_for(2)), (List{0, 1}));
    EXPECT_EQ(list(graph.waits_for(3)), (List{1}));
    EXPECT_TRUE(graph.targets(4).empty());
    EXPECT_TRUE(graph.is_target(3, 6));
    EXPECT_FALSE(graph.is_target(3, 3));
    EXPECT_EQ(graph.take(8), (List{0, 1}));
    EXPECT_TRUE(graph.take(8).empty());
    graph.done(1);
    EXPECT_EQ(graph.take(8), (List{3}));
    graph.done(3);
    graph.done(0);
    EXPECT_FALSE(graph.finished());
    EXPECT_EQ(graph.take(8), (List{2}));
    graph.done(2);
    EXPECT_TRUE(graph.finished());
}

TEST(RegionGraph, GeneratedCellsAreKnownFromTheStartAndRegionsWithoutTargetsAreDropped)
{
    const std::vector<uint8_t> generated = {1, 1, 1, 0, 1, 0};
    RegionGraph graph(make_regions({{0, 1, 2}, {3, 4, 0}, {2, 5}}), 6, generated);
    EXPECT_EQ(graph.region_count(), 2u);
    EXPECT_EQ(list(graph.targets(1)), (List{3}));
    EXPECT_EQ(graph.take(1), (List{1}));
    EXPECT_EQ(graph.take(1), (List{2}));
}

TEST(RegionGraph, NothingToDoIsFinishedAtOnce)
{
    EXPECT_TRUE(RegionGraph(make_regions({}), 0).finished());
    EXPECT_TRUE(RegionGraph(make_regions({{0, 1}}), 2, std::vector<uint8_t>{1, 1}).finished());
}

// takes batches of random size, finishes them in random order, and checks every rule on the way
void run_in_random_order(const Regions& regions, size_t cells, const std::vector<uint8_t>& generated, uint32_t seed)
{
    std::mt19937 random(seed);
    RegionGraph graph(regions, cells, generated);
    std::vector<uint8_t> known = generated;
    std::vector<uint32_t> running, writes(cells, 0);
    while (!graph.finished()) {
        for (uint32_t region : graph.take(random() % 7 + 1)) {
            for (uint32_t cell : regions.region(region))
                EXPECT_NE(graph.is_target(region, cell), bool(known[cell])) << "voxel " << cell;
            running.push_back(region);
        }
        ASSERT_FALSE(running.empty()) << "no region is ready and none is running";
        std::shuffle(running.begin(), running.end(), random);
        for (size_t count = random() % running.size() + 1; count > 0; --count) {
            for (uint32_t cell : graph.targets(running.back())) {
                known[cell] = 1;
                ++writes[cell];
            }
            graph.done(running.back());
            running.pop_back();
        }
    }
    for (size_t cell = 0; cell < cells; ++cell)
        EXPECT_EQ(writes[cell], generated[cell] ? 0u : 1u) << "voxel " << cell;
}

TEST(RegionGraph, InAnyOrderEveryCellIsWrittenOnceAndKnownCellsAreThereBefore)
{
    const auto cells = plane(60);
    const auto regions = extract_regions(cells, {.region_size = 60, .coverage_threshold = 16});
    ASSERT_TRUE(regions) << regions.error().message;
    for (uint32_t seed = 0; seed < 20; ++seed) {
        std::mt19937 random(seed);
        std::vector<uint8_t> generated(cells.size());
        for (auto& flag : generated)
            flag = seed % 2 == 0 ? 0 : random() % 3 == 0;
        run_in_random_order(*regions, cells.size(), generated, seed);
    }
}

TEST(RegionGraph, IndependentRegionsShareABatch)
{
    const auto cells = plane(120);
    const auto regions = extract_regions(cells, {});
    ASSERT_TRUE(regions) << regions.error().message;
    RegionGraph graph(*regions, cells.size());
    size_t batches = 0;
    for (; !graph.finished(); ++batches)
        for (uint32_t region : graph.take(8))
            graph.done(region);
    EXPECT_LT(3 * batches, graph.region_count()) << batches << " batches for " << graph.region_count() << " regions";
}

TEST(RegionGraph, AStoppedRunGoesOnWithTheSameTargets)
{
    const auto cells = plane(50);
    const auto regions = extract_regions(cells, {});
    ASSERT_TRUE(regions) << regions.error().message;
    RegionGraph whole(*regions, cells.size());
    std::vector<uint8_t> generated(cells.size(), 0);
    for (int step = 0; step < 5; ++step)
        for (uint32_t region : whole.take(2)) {
            for (uint32_t cell : whole.targets(region))
                generated[cell] = 1;
            whole.done(region);
        }
    const RegionGraph rest(*regions, cells.size(), generated);
    EXPECT_EQ(rest.region_count(), whole.region_count() - whole.done_count());
    for (uint32_t region = 0; region < regions->size(); ++region)
        if (!rest.targets(region).empty()) {
            EXPECT_EQ(list(rest.targets(region)), list(whole.targets(region)));
        }
}

TEST(RegionGraph, IsBuiltInUnderASecondForAHundredThousandCells)
{
    const auto cells = plane(316);
    const auto regions = extract_regions(cells, {});
    ASSERT_TRUE(regions) << regions.error().message;
    const auto start = std::chrono::steady_clock::now();
    RegionGraph graph(*regions, cells.size());
    while (!graph.finished())
        for (uint32_t region : graph.take(16))
            graph.done(region);
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 1.0);
}

} // namespace engine_region_graph_test
} // namespace semrover
