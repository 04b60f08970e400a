// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/voxfield/regions.h"
#include "tests/support/golden_tensors.h"
#include "tests/support/json_text.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <random>

namespace semrover {
namespace engine_regions_test {

using Cloud = std::vector<std::array<int32_t, 3>>;

int64_t squared_distance(const std::array<int32_t, 3>& a, const std::array<int32_t, 3>& b)
{
    int64_t sum = 0;
    for (int axis = 0; axis < 3; ++axis)
        sum += int64_t(a[axis] - b[axis]) * (a[axis] - b[axis]);
    return sum;
}

// Algorithm 1 as written, and strategy rim, in time n^2 * regions
class BruteForce {
  public:
    BruteForce(const Cloud& cloud, const RegionOptions& options)
        : cloud_(cloud), options_(options), distance_(cloud.size(), INT64_MAX), covered_(cloud.size(), false)
    {
    }

    Regions run()
    {
        regions_.offsets.push_back(0);
        std::vector<bool> deferred(cloud_.size(), false);
        add(uint32_t(options_.first_cell), region(uint32_t(options_.first_cell)));
        while (true) {
            const int64_t seed = nearest(deferred);
            if (seed < 0)
                break;
            const auto cells = region(uint32_t(seed));
            const auto fresh = std::count_if(cells.begin(), cells.end(), [&](uint32_t c) { return !covered_[c]; });
            if (fresh >= std::min(options_.coverage_threshold, most_targets(options_)))
                add(uint32_t(seed), cells);
            else if (options_.strategy == RegionStrategy::paper)
                break;
            else
                deferred[seed] = true;
        }
        deferred.assign(cloud_.size(), false);
        if (options_.strategy != RegionStrategy::paper)
            for (int64_t seed = nearest(deferred); seed >= 0; seed = nearest(deferred))
                add(uint32_t(seed), region(uint32_t(seed)));
        for (uint32_t cell = 0; cell < cloud_.size(); ++cell)
            if (!covered_[cell])
                regions_.uncovered.push_back(cell);
        return regions_;
    }

  private:
    std::vector<uint32_t> region(uint32_t seed) const
    {
        return options_.strategy == RegionStrategy::rim ? with_rim(knn(seed, options_.region_size * 5 / 2))
                                                        : knn(seed, options_.region_size);
    }

    // 13 of 16 voxels of a region are targets at most; a rim makes it whole, or at least half of one
    std::vector<uint32_t> with_rim(const std::vector<uint32_t>& near) const
    {
        std::vector<uint32_t> targets, known;
        for (uint32_t cell : near)
            (covered_[cell] ? known : targets).push_back(cell);
        const size_t most = options_.region_size - options_.region_size * 3 / 16;
        targets.resize(std::min(targets.size(), most));
        std::stable_sort(known.begin(), known.end(),
                         [&](uint32_t a, uint32_t b) { return nearest_of(a, targets) < nearest_of(b, targets); });
        const size_t rim = options_.region_size - most, half = options_.region_size / 2;
        known.resize(std::min(known.size(), std::max(rim, half - std::min(half, targets.size()))));
        std::vector<uint32_t> region;
        for (uint32_t cell : near)
            if (std::ranges::count(targets, cell) || std::ranges::count(known, cell))
                region.push_back(cell);
        return region;
    }

    int64_t nearest_of(uint32_t cell, const std::vector<uint32_t>& others) const
    {
        int64_t best = INT64_MAX;
        for (uint32_t other : others)
            best = std::min(best, squared_distance(cloud_[cell], cloud_[other]));
        return best;
    }

    std::vector<uint32_t> knn(uint32_t seed, int count) const
    {
        std::vector<uint32_t> order(cloud_.size());
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
            return squared_distance(cloud_[a], cloud_[seed]) < squared_distance(cloud_[b], cloud_[seed]);
        });
        order.resize(std::min<size_t>(order.size(), count));
        return order;
    }

    int64_t nearest(const std::vector<bool>& deferred) const
    {
        int64_t best = -1;
        for (size_t cell = 0; cell < cloud_.size(); ++cell)
            if (!covered_[cell] && !deferred[cell] && (best < 0 || distance_[cell] < distance_[best]))
                best = int64_t(cell);
        return best;
    }

    void add(uint32_t seed, const std::vector<uint32_t>& region)
    {
        for (uint32_t member : region) {
            covered_[member] = true;
            for (size_t cell = 0; cell < cloud_.size(); ++cell)
                distance_[cell] = std::min(distance_[cell], squared_distance(cloud_[cell], cloud_[member]));
        }
        regions_.members.insert(regions_.members.end(), region.begin(), region.end());
        regions_.offsets.push_back(uint32_t(regions_.members.size()));
        regions_.seeds.push_back(seed);
    }

    const Cloud& cloud_;
    RegionOptions options_;
    std::vector<int64_t> distance_;
    std::vector<bool> covered_;
    Regions regions_;
};

class Clouds {
  public:
    explicit Clouds(uint32_t seed) : random_(seed) {}

    int uniform(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

    // distinct voxels in random order: dense or sparse boxes, planes and lines, near and far clusters, wide negatives
    Cloud draw(int cells)
    {
        Cloud cloud;
        const int clusters = std::array{1, 1, 2, 5, 20}[uniform(0, 4)];
        const int reach = std::array{0, 10, 60, 5000, 1 << 17}[uniform(0, 4)];
        const int step = std::array{1, 1, 1, 7}[uniform(0, 3)];
        for (int k = 0; k < clusters; ++k) {
            const std::array<int, 3> origin = {uniform(-reach, reach), uniform(-reach, reach), uniform(-reach, reach)};
            std::array<int, 3> side;
            for (int axis = 0; axis < 3; ++axis)
                side[axis] = std::array{0, 2, 6, 12, 40}[uniform(0, 4)];
            for (int i = 0; i < cells / clusters + 1; ++i)
                cloud.push_back({origin[0] + step * uniform(0, side[0]), origin[1] + step * uniform(0, side[1]),
                                 origin[2] + step * uniform(0, side[2])});
        }
        std::sort(cloud.begin(), cloud.end());
        cloud.erase(std::unique(cloud.begin(), cloud.end()), cloud.end());
        std::shuffle(cloud.begin(), cloud.end(), random_);
        return cloud;
    }

    RegionOptions options(const Cloud& cloud)
    {
        RegionOptions options;
        options.region_size = std::array{1, 2, 5, 16, 40, 128}[uniform(0, 5)];
        options.coverage_threshold = uniform(1, options.region_size);
        options.strategy =
            std::array{RegionStrategy::paper, RegionStrategy::complete, RegionStrategy::rim}[uniform(0, 2)];
        options.first_cell = uniform(0, int(cloud.size()) - 1);
        return options;
    }

  private:
    std::mt19937 random_;
};

// ground with waves and facades, 2.5D, in scan order
Cloud street(int side, size_t cells)
{
    Cloud cloud;
    for (int x = 0; x < side; ++x)
        for (int y = 0; y < side; ++y) {
            cloud.push_back({x, y, int(2 * std::sin(x / 9.0) + 2 * std::cos(y / 7.0))});
            for (int z = 4; z < 18 && y % 60 == 0; ++z)
                cloud.push_back({x, y, z});
        }
    for (int i = 0; cloud.size() < cells; ++i)
        cloud.push_back({i % side, -1 - i / side / 20, i / side % 20});
    cloud.resize(cells);
    return cloud;
}

Cloud cells_of(const GoldenTensors& golden)
{
    const auto flat = golden.get<int32_t>("input.cells");
    Cloud cloud(flat.size() / 3);
    for (size_t i = 0; i < cloud.size(); ++i)
        cloud[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
    return cloud;
}

std::vector<uint32_t> indices(const GoldenTensors& golden, const char* tensor)
{
    const auto values = golden.get<int32_t>(tensor);
    return {values.begin(), values.end()};
}

TEST(Regions, GoldenCasesAreReproducedExactly)
{
    for (const char* name : {"regions_paper", "regions_complete", "regions_street"}) {
        const GoldenTensors golden(name);
        RegionOptions options;
        options.region_size = golden.params.at("region_size");
        options.coverage_threshold = golden.params.at("coverage_threshold");
        options.first_cell = golden.params.at("first_seed");
        options.strategy = golden.params.at("strategy") == "paper" ? RegionStrategy::paper : RegionStrategy::complete;
        const auto regions = extract_regions(cells_of(golden), options);
        ASSERT_TRUE(regions) << regions.error().message;
        EXPECT_EQ(regions->offsets, indices(golden, "expect.offsets")) << name;
        EXPECT_EQ(regions->members, indices(golden, "expect.members")) << name;
        EXPECT_EQ(regions->uncovered, indices(golden, "expect.uncovered")) << name;
    }
}

TEST(Regions, EqualBruteForceOnRandomClouds)
{
    Clouds clouds(7);
    for (int trial = 0; trial < 1000; ++trial) {
        const Cloud cloud = clouds.draw(std::array{1, 20, 150, 400}[trial % 4]);
        const RegionOptions options = clouds.options(cloud);
        const Regions expected = BruteForce(cloud, options).run();
        const auto regions = extract_regions(cloud, options);
        ASSERT_TRUE(regions) << regions.error().message;
        ASSERT_EQ(regions->seeds, expected.seeds) << "trial " << trial << ", " << cloud.size() << " voxels";
        ASSERT_EQ(regions->offsets, expected.offsets) << "trial " << trial;
        ASSERT_EQ(regions->members, expected.members) << "trial " << trial;
        ASSERT_EQ(regions->uncovered, expected.uncovered) << "trial " << trial;
    }
}

TEST(Regions, CompleteAndRimCoverEveryCell)
{
    Clouds clouds(11);
    for (int trial = 0; trial < 200; ++trial) {
        const Cloud cloud = clouds.draw(4000);
        RegionOptions options = clouds.options(cloud);
        options.strategy = trial % 2 ? RegionStrategy::rim : RegionStrategy::complete;
        const auto regions = extract_regions(cloud, options);
        ASSERT_TRUE(regions) << regions.error().message;
        EXPECT_TRUE(regions->uncovered.empty());
        std::vector<bool> covered(cloud.size(), false);
        for (uint32_t cell : regions->members)
            covered[cell] = true;
        EXPECT_EQ(std::count(covered.begin(), covered.end(), false), 0) << "trial " << trial;
    }
}

TEST(Regions, ARimIsWhatLiesNextToTheTargetsAndRegionsOverlapLess)
{
    const Cloud cloud = street(100, 12'000);
    const auto complete = extract_regions(cloud, {.coverage_threshold = 48});
    const auto rim = extract_regions(cloud, {.coverage_threshold = 48, .strategy = RegionStrategy::rim});
    ASSERT_TRUE(complete && rim);
    EXPECT_LT(double(rim->members.size()), 0.55 * double(complete->members.size()));
    std::vector<bool> covered(cloud.size(), false);
    for (size_t r = 0; r < rim->size(); ++r) {
        std::vector<uint32_t> targets, known;
        for (uint32_t cell : rim->region(r))
            (covered[cell] ? known : targets).push_back(cell);
        ASSERT_GE(targets.size(), 1u);
        ASSERT_LE(targets.size(), 104u);
        ASSERT_LE(known.size(), std::max<size_t>(24, 64 - std::min<size_t>(64, targets.size())));
        for (uint32_t cell : targets)
            covered[cell] = true;
    }
}

TEST(Regions, WithARimKnownCellsAreNoTargets)
{
    const Cloud cloud = street(40, 1'600);
    std::vector<uint8_t> known(cloud.size(), 0);
    for (size_t cell = 0; cell < cloud.size(); ++cell)
        known[cell] = cloud[cell][0] < 20;
    const auto regions = extract_regions(cloud, {.strategy = RegionStrategy::rim}, known);
    ASSERT_TRUE(regions);
    std::vector<uint8_t> covered = known;
    for (size_t r = 0; r < regions->size(); ++r) {
        size_t fresh = 0;
        for (uint32_t cell : regions->region(r))
            fresh += !std::exchange(covered[cell], 1);
        EXPECT_GE(fresh, 1u);
    }
    EXPECT_EQ(std::ranges::count(covered, 0), 0);
    EXPECT_FALSE(known[regions->seeds[0]]);
}

TEST(Regions, AMillionCellsTakeUnderTenSeconds)
{
    const Cloud cloud = street(900, 1'000'000);
    for (const RegionStrategy strategy : {RegionStrategy::complete, RegionStrategy::rim}) {
        const auto start = std::chrono::steady_clock::now();
        const auto regions = extract_regions(cloud, {.strategy = strategy});
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        ASSERT_TRUE(regions) << regions.error().message;
        EXPECT_TRUE(regions->uncovered.empty());
        RecordProperty("seconds_" + std::string(region_strategy_name(strategy)), std::to_string(seconds));
#if defined(__OPTIMIZE__) && !defined(__SANITIZE_ADDRESS__)
        EXPECT_LT(seconds, 10) << "measured 1.0 s on one core of a 2-core Xeon";
#endif
    }
}

TEST(Regions, BadInputIsRefusedWithTheReason)
{
    const Cloud two = {{0, 0, 0}, {1, 0, 0}};
    const auto message = [](const Cloud& cloud, RegionOptions options) {
        const auto regions = extract_regions(cloud, options);
        EXPECT_FALSE(regions);
        EXPECT_EQ(regions ? ErrorCode::internal : regions.error().code, ErrorCode::bad_input);
        return regions ? std::string() : regions.error().message;
    };
    EXPECT_NE(message({}, {}).find("no voxels"), std::string::npos);
    EXPECT_NE(message({{4, 5, 6}, {0, 0, 0}, {4, 5, 6}}, {}).find("(4, 5, 6) appears twice"), std::string::npos);
    EXPECT_NE(message(two, {.region_size = 4097}).find("region_size"), std::string::npos);
    EXPECT_NE(message(two, {.region_size = 0}).find("region_size"), std::string::npos);
    EXPECT_NE(message(two, {.coverage_threshold = 0}).find("coverage_threshold"), std::string::npos);
    EXPECT_NE(message(two, {.coverage_threshold = 129}).find("coverage_threshold"), std::string::npos);
    EXPECT_NE(message(two, {.first_cell = 2}).find("first_cell"), std::string::npos);
    EXPECT_NE(message(two, {.first_cell = -1}).find("first_cell"), std::string::npos);
    EXPECT_NE(message({{INT32_MIN, 0, 0}, {INT32_MAX, 0, 0}, {0, 0, 0}}, {}).find("too wide"), std::string::npos);
}

TEST(Regions, CellsFarFromTheOriginAreExact)
{
    Cloud cloud = {{INT32_MIN, INT32_MIN, INT32_MAX},
                   {INT32_MIN + 2, INT32_MIN, INT32_MAX},
                   {INT32_MIN + 1, INT32_MIN, INT32_MAX}};
    const auto regions = extract_regions(cloud, {.region_size = 2, .coverage_threshold = 1});
    ASSERT_TRUE(regions) << regions.error().message;
    EXPECT_EQ(regions->members, (std::vector<uint32_t>{0, 2, 1, 2}));
}

} // namespace engine_regions_test
} // namespace semrover
