// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_split_test {

constexpr uint32_t kChannels = 1280;

DeviceLimits matrix_limits()
{
    DeviceLimits limits = test_limits();
    limits.needs_supported = kNeedsFloat16 | kNeedsCooperativeMatrix | kNeedsSubgroupVote;
    limits.matrix = {16, 16, 16, 32, false};
    limits.max_shared_bytes = 48 << 10;
    limits.max_group_threads = 1024;
    return limits;
}

// images of side x side pixels, a K of 9 x 1280 columns, as in the middle of a UNet
Plan conv_plan(uint32_t batch, uint32_t side, uint32_t outputs, const DeviceLimits& limits)
{
    Graph g;
    const uint32_t rows = batch * side * side;
    const FeatureMap x{fake_external(g, rows, kChannels, DType::f16), batch, side, side};
    const Tensor w = fake_external(g, outputs, 9 * kChannels, DType::f16);
    FeatureMap y = conv2d(g, x, {}, w, fake_external(g, 1, outputs));
    y = y.with(add(g, y.data, fake_external(g, rows, outputs, DType::f16)));
    (void)channel_moments(g, y);
    return planned(g, limits);
}

// 1: the sums of all of K are made by one workgroup
uint32_t slices(const Pass& pass)
{
    const auto set = pass.constants.find(pass.variant->constant("kSlices")->id);
    return set == pass.constants.end() ? 1 : set->second;
}

// rows of the products, each followed by the pass that adds its slices; all rows come once, and the device binds all
std::vector<uint32_t> expect_pairs(const Plan& plan, uint32_t rows, const DeviceLimits& limits)
{
    std::vector<uint32_t> bands;
    uint32_t next = 0;
    for (size_t i = 0; i < plan.passes.size(); ++i) {
        const Pass& pass = plan.passes[i];
        const bool adds = pass.constants.contains(pass.variant->constant("kAddSlices")->id);
        EXPECT_EQ(adds, i % 2 == 1);
        EXPECT_EQ(pass.grid.z, adds ? 1 : slices(pass));
        EXPECT_EQ(pushed(pass, "first_row"), next);
        for (const PassBinding& b : pass.bindings) {
            EXPECT_LE(b.bytes, limits.max_storage_range) << b.name;
            EXPECT_EQ(b.offset % limits.offset_alignment, 0u) << b.name;
        }
        if (!adds)
            continue;
        EXPECT_EQ(pushed(pass, "rows"), pushed(plan.passes[i - 1], "rows"));
        bands.push_back(pushed(pass, "rows"));
        next += bands.back();
    }
    EXPECT_EQ(next, rows);
    return bands;
}

TEST(graph_split, cuts_k_by_the_size_of_an_image_and_not_by_how_many_there_are)
{
    const DeviceLimits limits = matrix_limits(); // binds 128 MiB, the least that Vulkan promises: 51 images' sums
    for (const uint32_t batch : {1u, 2u, 51u, 52u, 103u}) {
        SCOPED_TRACE(batch);
        const Plan plan = conv_plan(batch, 8, 1280, limits);
        for (const Pass& pass : plan.passes)
            EXPECT_EQ(slices(pass), 8u);
        const std::vector<uint32_t> bands = expect_pairs(plan, batch * 64, limits);
        EXPECT_EQ(bands.size(), divide_up(batch, 51));
        for (const uint32_t rows : bands)
            EXPECT_EQ(rows % 64, 0u); // whole images
    }
}

TEST(graph_split, cuts_k_of_no_batch_where_the_sums_of_one_image_are_too_large)
{
    DeviceLimits limits = matrix_limits();
    EXPECT_EQ(slices(conv_plan(1, 64, 64, limits).passes[0]), 4u);
    limits.max_storage_range = 2 << 20; // of 4 MiB of sums
    for (const uint32_t batch : {1u, 3u}) {
        const Plan plan = conv_plan(batch, 64, 64, limits);
        EXPECT_GT(plan.passes.size(), batch); // of x there is more than that
        for (const Pass& pass : plan.passes)
            EXPECT_EQ(slices(pass), 1u);
    }
}

} // namespace graph_split_test
} // namespace semrover
