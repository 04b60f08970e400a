// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "conv2d.spv.h"
#include "gemm.spv.h"
#include "kernels/network/matmul_tiles.h"
#include "tests/support/feature_map_case.h"

namespace semrover {
namespace kernel_matmul_tiles_test {

// large and small, rectangular, more than one part of a subgroup, steps that do and do not divide K, loads that are not
// shared evenly, both ways to stage, every other way to go through K or through the tiles
const MatmulTile kTiles[] = {
    {.rows = 32, .cols = 32, .step = 64},
    {.rows = 32, .cols = 32, .step = 16, .stages = 2},
    {.rows = 64, .cols = 64, .step = 32, .strip = 32},
    {.rows = 64, .cols = 64, .step = 16, .ahead = true, .rows_of_tiles = 2},
    {.rows = 128, .cols = 64, .step = 32, .stages = 2, .ahead = true, .strip = 32},
    {.rows = 64, .cols = 160, .step = 32, .rows_of_tiles = 3},
    {.rows = 128, .cols = 80, .down = 4, .step = 32, .ahead = true},
    {.rows = 128, .cols = 80, .down = 4, .step = 16, .stages = 2},
    {.rows = 128, .cols = 160, .down = 4, .subgroups = 8, .step = 32},
    {.rows = 128, .cols = 128, .subgroups = 8, .step = 32, .strip = 32},
    {.rows = 128, .cols = 128, .step = 16, .stages = 2, .ahead = true, .strip = 64},
    {.rows = 256, .cols = 128, .down = 4, .subgroups = 8, .step = 16},
};

std::vector<MatmulTile> tiles_with_room(const Kernel& kernel)
{
    const DeviceLimits& limits = test_device().limits();
    const KernelVariant& variant = Graph(limits).variant(kernel);
    std::vector<MatmulTile> tiles;
    if (variant.features & kFeatureCooperativeMatrix)
        std::ranges::copy_if(kTiles, std::back_inserter(tiles),
                             [&](const MatmulTile& t) { return has_room_for(variant, limits, t); });
    return tiles;
}

std::string text(const MatmulTile& t)
{
    return fmt::format("{}x{} by {} of {}, steps of {} in {}, ahead {}, strips of {}, {} rows of tiles", t.rows, t.cols,
                       t.down, t.subgroups, t.step, t.stages, t.ahead, t.strip, t.rows_of_tiles);
}

void expect_same(const HostMatrix& a, const HostMatrix& b)
{
    ASSERT_EQ(a.values.size(), b.values.size());
    for (size_t i = 0; i < a.values.size(); ++i)
        ASSERT_EQ(a.values[i], b.values[i]) << "value " << i;
}

// rows and columns that no tile divides; a K of whole steps, and one that ends within
TEST(kernel_matmul_tiles, give_a_product_the_same_bits)
{
    const std::vector<MatmulTile> tiles = tiles_with_room(kernel::gemm);
    if (tiles.empty())
        GTEST_SKIP() << "no matrix units here";
    EXPECT_GT(tiles.size(), 8u);
    const auto run = [&](uint32_t depth, bool gated, const MatmulTile* tile) {
        KernelCase k(test_device());
        const DType half = DType::f16;
        const HostMatrix x = k.random(301, depth, half), w = k.random(336, depth, half);
        const HostMatrix bias = k.random(1, 336, DType::f32), residual = k.random(301, 336, half);
        Tensor y = gemm(k.graph, k.input(x), k.input(w), k.input(bias), {.dtype = half, .tile = tile});
        y = gated ? geglu(k.graph, y) : add(k.graph, gelu(k.graph, y), k.input(residual));
        HostMatrix got = k.run(y);
        EXPECT_EQ(k.plan().passes.size(), 1u);
        k.expect_zero_padding(got);
        return got;
    };
    const HostMatrix wanted[] = {run(128, true, nullptr), run(200, false, nullptr)};
    for (size_t i = 0; i < tiles.size(); ++i) { // a pipeline takes seconds to compile
        SCOPED_TRACE(text(tiles[i]));
        expect_same(run(i % 2 ? 200 : 128, i % 2 == 0, &tiles[i]), wanted[i % 2]);
    }
}

// two inputs, and K in slices; with moments, which lie in the slab as well
TEST(kernel_matmul_tiles, give_a_convolution_the_same_bits)
{
    const std::vector<MatmulTile> tiles = tiles_with_room(kernel::conv2d);
    if (tiles.empty())
        GTEST_SKIP() << "no matrix units here";
    struct Case {
        uint32_t batch, height, width, channels, channels2, outputs;
    };
    const Case cases[] = {{2, 13, 11, 32, 24, 176}, {2, 12, 8, 64, 0, 96}, {2, 3, 4, 264, 250, 72}};
    const auto run = [&](const Case& c, const MatmulTile* tile) {
        KernelCase k(test_device());
        const DType half = DType::f16;
        const HostImages x = random_images(k, c.batch, c.height, c.width, c.channels, half);
        const HostImages x2 =
            c.channels2 ? random_images(k, c.batch, c.height, c.width, c.channels2, half) : HostImages{};
        const HostMatrix w = k.random(c.outputs, 9 * (round_up(c.channels, 8) + round_up(c.channels2, 8)), half);
        const HostMatrix bias = k.random(1, c.outputs, DType::f32);
        FeatureMap y = conv2d(k.graph, x.input(k), c.channels2 ? x2.input(k) : FeatureMap{}, k.input(w), k.input(bias),
                              {.dtype = half, .tile = tile});
        const Tensor moments = channel_moments(k.graph, y);
        const Tensor out = k.output(moments.rows, moments.cols, DType::f32, moments.ld);
        k.graph.keep(moments, out);
        HostMatrix got = k.run(y.data);
        const HostMatrix statistics = k.read(out);
        got.values.insert(got.values.end(), statistics.values.begin(), statistics.values.end());
        return got;
    };
    const HostMatrix wanted[] = {run(cases[0], nullptr), run(cases[1], nullptr), run(cases[2], nullptr)};
    for (size_t i = 0; i < tiles.size(); ++i) {
        SCOPED_TRACE(text(tiles[i]));
        expect_same(run(cases[i % 3], &tiles[i]), wanted[i % 3]);
    }
}

// what a device of so many units is given first, and what it tries
TEST(kernel_matmul_tiles, fill_the_units_of_a_device)
{
    DeviceLimits limits;
    limits.type = DeviceType::discrete;
    limits.features = ~0u;
    limits.matrix = {.m = 16, .n = 16, .k = 16, .subgroup = 32};
    limits.max_shared_bytes = 49152;
    limits.max_group_threads = 1024;
    limits.compute_units = 132;
    const auto first = [&](const MatmulShape& shape) {
        const KernelVariant& variant = Graph(limits).variant(kernel::conv2d);
        const MatmulTiles made = matmul_tiles(variant, limits, shape);
        EXPECT_LE(made.alternatives.size(), 4u);
        return made.alternatives.front().tile;
    };
    EXPECT_EQ(first({8192, 320, 1, {320}}), (Tile{128, 160}));   // 128 of them, where squares of 128 need two rounds
    EXPECT_EQ(first({2048, 640, 2, {640}}), (Tile{128, 160}));   // two slices of 64
    EXPECT_EQ(first({4096, 4096, 1, {4096}}), (Tile{128, 128})); // all fill it; 26 columns of 160 are 64 too wide
    EXPECT_EQ(first({128, 320, 1, {64}}), (Tile{32, 32}));
    limits.max_shared_bytes = 32768;
    EXPECT_EQ(first({8192, 320, 1, {320}}), (Tile{128, 160})); // in steps of 32
}

} // namespace kernel_matmul_tiles_test
} // namespace semrover
