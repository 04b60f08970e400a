// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/voxfield/sub_grid.h"

#include "engine/scene/cell_reach.h"
#include "engine/world/grid_filling.h"
#include "runtime/base/dtype.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <random>
#include <set>

namespace semrover {
namespace engine_sub_grid_test {

const std::string kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

constexpr int kPoints = 20; // of the model

// a road of 60 x 16 voxels with a wall beside it, every voxel with points of its own
VoxelGrid street()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < 60; ++i)
        for (int32_t j = 0; j < 16; ++j)
            for (int32_t k = 0; k < (j == 15 ? 4 : 1); ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(j == 15 ? 2 : 0);
            }
    make_room_for_points(grid, kPoints);
    for (size_t v = 0; v < grid.points.size(); ++v) {
        grid.points[v] = float_to_half(float(v * 7 % 501) / 1000 - 0.25f);
        grid.colors[v] = uint8_t(v * 13);
    }
    grid.generated.assign(grid.cells.size(), 1);
    return grid;
}

std::vector<uint32_t> disc(const VoxelGrid& grid, int32_t i, int32_t j, int64_t reach2)
{
    return cells_within(grid.cells, std::vector<Cell>{{i, j, 0}}, reach2);
}

RegionOptions options(RegionStrategy strategy = RegionStrategy::complete)
{
    RegionOptions o;
    o.strategy = strategy;
    o.region_size = 40;
    o.coverage_threshold = 10;
    o.from_known = true;
    return o;
}

void generate(VoxelGrid& grid, uint32_t batch, const RegionOptions& regions = options())
{
    GenerationSettings settings;
    settings.model = *VoxfieldModel::open(kModel, {}, Sampler::ddpm);
    settings.plan = *plan_sampling(settings.model.scheduler, 2);
    settings.guidance.scale = 2;
    settings.batch = batch;
    GridFilling filling(device(), settings);
    const Status cut = filling.cut(grid, regions);
    ASSERT_TRUE(cut) << cut.error().message;
    ASSERT_TRUE(filling.load(5, {}));
    ASSERT_TRUE(filling.start(nullptr));
    const auto filled = filling.step(JobBudget::unlimited());
    ASSERT_TRUE(filled) << filled.error().message;
    EXPECT_TRUE(*filled);
}

void expect_a_part_gives_the_bytes_of_the_whole(const RegionOptions& regions)
{
    const VoxelGrid before = street();
    const std::vector<uint32_t> targets = disc(before, 31, 12, 30);
    VoxelGrid whole = before;
    for (const uint32_t target : targets)
        whole.generated[target] = 0;
    auto part = cut_sub_grid(before, targets, cells_considered(regions));
    ASSERT_TRUE(part) << part.error().message;
    EXPECT_LT(part->cells.size(), before.cells.size() / 2);
    EXPECT_EQ(std::ranges::count(part->grid.generated, 0), int64_t(targets.size()));
    generate(whole, 1, regions);
    generate(part->grid, 3, regions);
    VoxelGrid result = before;
    put_back(result, *part, targets);
    EXPECT_EQ(result.points, whole.points);
    EXPECT_EQ(result.colors, whole.colors);
    EXPECT_EQ(result.generated, whole.generated);
    const size_t width = size_t(before.points_per_voxel) * 3;
    size_t differ = 0;
    for (uint32_t c = 0; c < before.cells.size(); ++c) {
        const bool same =
            std::equal(&before.points[c * width], &before.points[c * width] + width, &result.points[c * width]);
        differ += !same;
        EXPECT_TRUE(same || std::ranges::binary_search(targets, c)) << c;
    }
    EXPECT_EQ(differ, targets.size());
}

TEST(engine_sub_grid, filling_a_part_gives_the_bytes_of_filling_the_whole_and_changes_nothing_else)
{
    for (const RegionStrategy strategy : {RegionStrategy::complete, RegionStrategy::rim})
        expect_a_part_gives_the_bytes_of_the_whole(options(strategy));
}

TEST(engine_sub_grid, cells_without_points_that_nobody_asked_for_stay_out)
{
    VoxelGrid grid = street();
    const std::vector<uint32_t> targets = disc(grid, 20, 8, 4);
    const std::vector<uint32_t> bare = disc(grid, 26, 8, 4);
    for (const uint32_t c : bare)
        grid.generated[c] = 0;
    const auto part = cut_sub_grid(grid, targets, 40);
    ASSERT_TRUE(part);
    for (const uint32_t c : bare)
        EXPECT_FALSE(std::ranges::binary_search(part->cells, c));
    for (const uint32_t c : targets)
        EXPECT_TRUE(std::ranges::binary_search(part->cells, c));
}

TEST(engine_sub_grid, the_reach_grows_until_regions_are_whole)
{
    VoxelGrid line; // a wire: 40 voxels lie 20 to either side
    line.voxel_size = 0.6f;
    for (int32_t i = 0; i < 400; ++i) {
        line.cells.push_back({i, 0, 0});
        line.labels.push_back(5);
    }
    make_room_for_points(line, 4);
    line.generated.assign(400, 1);
    const std::vector<uint32_t> targets = {200};
    EXPECT_EQ(cut_sub_grid(line, targets, 10)->cells.size(), 17u);
    EXPECT_EQ(cut_sub_grid(line, targets, 40)->cells.size(), 65u);
    EXPECT_EQ(cut_sub_grid(line, targets, 400)->cells.size(), 129u); // 64 voxels are the end
}

TEST(engine_sub_grid, a_grid_without_points_gets_room_for_them)
{
    VoxelGrid grid = street();
    grid.points.clear();
    grid.colors.clear();
    grid.generated.clear();
    const std::vector<uint32_t> targets = disc(grid, 20, 8, 9);
    auto part = cut_sub_grid(grid, targets, 40);
    ASSERT_TRUE(part);
    EXPECT_EQ(part->cells, targets); // nothing around them is known
    generate(part->grid, 2);
    put_back(grid, *part, targets);
    EXPECT_EQ(std::ranges::count(grid.generated, 1), int64_t(targets.size()));
    EXPECT_EQ(grid.points.size(), grid.cells.size() * size_t(kPoints) * 3);
}

// ---- regions that grow from what is known, against the algorithm written down plainly

Regions plain_regions(const std::vector<Cell>& cells, std::vector<uint8_t> covered, const RegionOptions& o)
{
    const auto distance = [&](uint32_t a, uint32_t b) {
        int64_t d = 0;
        for (size_t x = 0; x < 3; ++x)
            d += int64_t(cells[a][x] - cells[b][x]) * (cells[a][x] - cells[b][x]);
        return d;
    };
    Regions out;
    out.offsets.push_back(0);
    const auto region_of = [&](uint32_t seed) {
        std::vector<std::pair<int64_t, uint32_t>> near;
        for (uint32_t c = 0; c < cells.size(); ++c)
            near.push_back({distance(seed, c), c});
        std::ranges::sort(near);
        near.resize(std::min<size_t>(near.size(), size_t(o.region_size)));
        return near;
    };
    std::vector<uint8_t> aside(cells.size(), 0);
    bool rest = false;
    while (true) {
        std::pair<int64_t, uint32_t> best{INT64_MAX, 0};
        for (uint32_t c = 0; c < cells.size(); ++c)
            for (uint32_t k = 0; k < cells.size() && !covered[c] && (rest || !aside[c]); ++k)
                if (covered[k])
                    best = std::min(best, {distance(c, k), c});
        if (best.first == INT64_MAX && rest)
            break;
        if (best.first == INT64_MAX) {
            rest = true;
            continue;
        }
        const auto near = region_of(best.second);
        const auto fresh = std::ranges::count_if(near, [&](const auto& n) { return !covered[n.second]; });
        if (!rest && fresh < o.coverage_threshold) {
            aside[best.second] = 1;
            continue;
        }
        for (const auto& n : near) {
            out.members.push_back(n.second);
            covered[n.second] = 1;
        }
        out.offsets.push_back(uint32_t(out.members.size()));
        out.seeds.push_back(best.second);
    }
    return out;
}

TEST(engine_sub_grid, regions_grow_from_the_known_cells_as_the_plain_algorithm_says)
{
    std::mt19937 random(3);
    for (int cloud = 0; cloud < 20; ++cloud) {
        std::set<Cell> set;
        while (set.size() < 120)
            set.insert({int32_t(random() % 12), int32_t(random() % 12), int32_t(random() % 3)});
        const std::vector<Cell> cells(set.begin(), set.end());
        std::vector<uint8_t> known(cells.size());
        for (uint8_t& k : known)
            k = random() % 4 != 0;
        known[0] = 1;
        RegionOptions o = options();
        o.region_size = 20;
        o.coverage_threshold = 1 + cloud % 12;
        const auto found = extract_regions(cells, o, known);
        ASSERT_TRUE(found);
        const Regions expected = plain_regions(cells, known, o);
        EXPECT_EQ(found->seeds, expected.seeds);
        EXPECT_EQ(found->members, expected.members);
        EXPECT_TRUE(found->uncovered.empty());
    }
    const std::vector<Cell> two = {{0, 0, 0}, {1, 0, 0}};
    EXPECT_EQ(extract_regions(two, options(), std::vector<uint8_t>{1, 1})->size(), 0u);
}

} // namespace engine_sub_grid_test
} // namespace semrover
