// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/graph/autotuner.h"
#include "tests/support/graph_memory.h"

namespace semrover {
namespace graph_tiles_test {

DeviceLimits simt_limits()
{
    DeviceLimits limits = test_limits();
    limits.force_variant = "simt";
    return limits;
}

// two products that take alike
Plan products(uint32_t rows = 4096, DType dtype = DType::f32)
{
    Graph g(simt_limits());
    const Tensor x = fake_external(g, rows, 512, dtype), w = fake_external(g, 512, 512, dtype);
    (void)gemm(g, gemm(g, x, w, {}, {.dtype = dtype}), w, {}, {.dtype = dtype});
    return planned(g);
}

std::vector<uint32_t> tiles(const Plan& plan)
{
    std::vector<uint32_t> sizes;
    for (const Pass& pass : plan.passes) {
        EXPECT_EQ(pass.options.alternatives.size(), 2u);
        const Tile tile = pass.grid.tile;
        EXPECT_EQ(tile, pass.options.alternatives.at(pass.alternative).tile);
        EXPECT_EQ(tile.rows, tile.cols);
        EXPECT_EQ(pass.group_count[0], divide_up(pass.grid.x, tile.rows));
        EXPECT_EQ(pass.group_count[1], divide_up(pass.grid.y, tile.cols));
        sizes.push_back(tile.rows);
    }
    return sizes;
}

// runs until nothing is tried any more; seconds of a pass with a tile of 64, and of 32
std::vector<std::vector<uint32_t>> try_all(Plan& plan, TuningCache& cache, double of_64, double of_32)
{
    auto trial = Autotuner::begin(plan, simt_limits(), cache);
    EXPECT_TRUE(trial);
    std::vector<std::vector<uint32_t>> tried;
    while (trial->running() && tried.size() < 20) {
        tried.push_back(tiles(plan));
        std::vector<double> seconds;
        for (const Pass& pass : plan.passes)
            seconds.push_back(pass.grid.tile.rows == 64 ? of_64 : of_32);
        EXPECT_TRUE(trial->next(plan, seconds, simt_limits(), cache));
    }
    return tried;
}

using Tried = std::vector<std::vector<uint32_t>>;

TEST(graph_tiles, are_each_tried_twice_and_the_fastest_is_kept)
{
    Plan plan = products();
    ASSERT_EQ(tiles(plan), (std::vector<uint32_t>{64, 64})); // 512 workgroups
    TuningCache cache;
    EXPECT_EQ(try_all(plan, cache, 2e-3, 1e-3), (Tried{{64, 64}, {32, 32}, {64, 64}, {32, 32}}));
    EXPECT_EQ(tiles(plan), (std::vector<uint32_t>{32, 32}));
    EXPECT_EQ(cache.best(TuningCache::key(plan.passes[0])), 1u); // the second of 64 and 32
}

TEST(graph_tiles, stay_the_first_where_no_other_is_clearly_faster_or_nothing_was_measured)
{
    for (const auto& [of_64, of_32] : {std::pair{1e-3, 0.99e-3}, {1e-3, 1.2e-3}, {0., 0.}}) {
        Plan plan = products();
        TuningCache cache;
        (void)try_all(plan, cache, of_64, of_32);
        EXPECT_EQ(tiles(plan), (std::vector<uint32_t>{64, 64})) << of_64 << ' ' << of_32;
    }
    Plan small = products(64);
    ASSERT_EQ(tiles(small), (std::vector<uint32_t>{32, 32}));
    TuningCache cache;
    EXPECT_EQ(try_all(small, cache, 1e-3, 2e-3).front(), (std::vector<uint32_t>{32, 32}));
    EXPECT_EQ(tiles(small), (std::vector<uint32_t>{64, 64}));
}

TEST(graph_tiles, that_are_known_are_not_tried_again)
{
    Plan first = products(), other = products(2048);
    TuningCache cache;
    (void)try_all(first, cache, 2e-3, 1e-3);
    Plan second = products();
    const auto trial = Autotuner::begin(second, simt_limits(), cache);
    ASSERT_TRUE(trial);
    EXPECT_FALSE(trial->running());
    EXPECT_TRUE(trial->changed());
    EXPECT_EQ(tiles(second), (std::vector<uint32_t>{32, 32}));
    EXPECT_EQ(try_all(other, cache, 2e-3, 1e-3).size(), 4u);
    // one that this pass cannot have: kept by another version, or made up
    Plan third = products();
    cache.set(TuningCache::key(third.passes[0]), 2);
    EXPECT_EQ(try_all(third, cache, 2e-3, 1e-3).size(), 4u);
    EXPECT_EQ(tiles(third), (std::vector<uint32_t>{32, 32}));
}

TEST(graph_tiles, are_known_by_what_a_pass_does_and_could_but_not_by_its_tile)
{
    Plan plan = products();
    Pass& pass = plan.passes[0];
    const TuningCache::Key key = TuningCache::key(pass);
    pass.take(1);
    EXPECT_EQ(TuningCache::key(pass), key);
    EXPECT_EQ(TuningCache::key(plan.passes.back()), key);
    EXPECT_NE(TuningCache::key(products(4032).passes[0]), key);
    EXPECT_NE(TuningCache::key(products(4096, DType::f16).passes[0]), key);
}

TEST(graph_tiles, are_read_from_what_was_written)
{
    TuningCache cache;
    cache.set(0x1, 64);
    cache.set(0xfedcba9876543210, 32);
    const std::string text = cache.text();
    EXPECT_EQ(text, "0000000000000001 64\nfedcba9876543210 32\n");
    TuningCache again;
    again.read(text);
    EXPECT_EQ(again.text(), text);
    TuningCache odd;
    odd.read("\n \n1\n1 \n x\n2 32x\ng 32\n3 32 4\n11112222333344445 32\n4 -1\n5 64\n6 64");
    EXPECT_EQ(odd.text(), "0000000000000005 64\n");
}

} // namespace graph_tiles_test
} // namespace semrover
