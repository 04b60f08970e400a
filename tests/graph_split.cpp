// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_split_test {

constexpr uint32_t kChannels = 1280;

DeviceLimits matrix_limits()
{
    DeviceLimits limits = test_limits();
    limits.features = kFeatureFloat16 | kFeatureCooperativeMatrix | kFeatureSubgroupVote;
    limits.matrix = {16, 16, 16, 32, false};
    limits.max_shared_bytes = 48 << 10;
    limits.max_group_threads = 1024;
    return limits;
}

// images of side x side pixels, a K of 9 x 1280 columns, as in the middle of a UNet
Plan conv_plan(uint32_t batch, uint32_t side, uint32_t outputs, const DeviceLimits& limits)
{
    Graph g(limits);
    const uint32_t rows = batch * side * side;
    const FeatureMap x{fake_external(g, rows, kChannels, DType::f16), batch, side, side};
    const Tensor w = fake_external(g, outputs, 9 * kChannels, DType::f16);
    FeatureMap y = conv2d(g, x, {}, w, fake_external(g, 1, outputs));
    y = y.with(add(g, y.data, fake_external(g, rows, outputs, DType::f16)));
    (void)channel_moments(g, y);
    return planned(g);
}

// into how many slices K is cut; 1: the sums of all of K are made by one workgroup
uint32_t slices(const Pass& pass)
{
    const auto set = pass.constants.find(pass.variant->constant("kSlices")->id);
    return set == pass.constants.end() ? pass.variant->value("kSlices") : set->second;
}

// products, then what adds their slices and does the epilogue; all rows come once, and the device binds all
void expect_all_rows(const Plan& plan, std::string_view kernel, uint32_t rows, const DeviceLimits& limits)
{
    uint32_t next = 0;
    for (const Pass& pass : plan.passes) {
        if (pass.kernel->name != kernel)
            continue;
        EXPECT_EQ(pushed(pass, "first_row"), next);
        next += pushed(pass, "rows");
        for (const PassBinding& b : pass.bindings) {
            EXPECT_LE(b.bytes, limits.max_storage_range) << b.name;
            EXPECT_TRUE(!b.given() || b.offset % limits.offset_alignment == 0) << b.name;
        }
    }
    EXPECT_EQ(next, rows);
}

TEST(graph_split, cuts_k_by_the_size_of_an_image_and_not_by_how_many_there_are)
{
    const DeviceLimits limits = matrix_limits(); // binds 128 MiB, the least that Vulkan promises: 51 images' sums
    for (const uint32_t batch : {1u, 2u, 51u, 52u, 103u}) {
        SCOPED_TRACE(batch);
        const Plan plan = conv_plan(batch, 8, 1280, limits);
        EXPECT_EQ(plan.fused, 2u); // the residual and the moments go into the epilogue of what adds
        for (const Pass& pass : plan.passes)
            EXPECT_EQ(slices(pass), 8u);
        EXPECT_EQ(plan.passes.size(), 2 * divide_up(batch, 51));
        for (const char* kernel : {"conv2d", "split_k_reduce"})
            expect_all_rows(plan, kernel, batch * 64, limits);
    }
    EXPECT_EQ(conv_plan(1, 64, 320, limits).passes.size(), 1u); // 320 tiles: enough
}

} // namespace graph_split_test
} // namespace semrover
