// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_slice_test {

const PassBinding& binding(const Pass& pass, std::string_view name)
{
    for (const PassBinding& b : pass.bindings)
        if (b.name == name)
            return b;
    ADD_FAILURE() << "no binding " << name;
    return pass.bindings.front();
}

// bands of `rows` rows are aligned, within the range, and one after the other without a gap
void expect_bands(const Plan& plan, std::string_view name, uint32_t rows, uint64_t row_bytes,
                  const DeviceLimits& limits)
{
    uint64_t next = 0;
    for (const Pass& pass : plan.passes) {
        const PassBinding& b = binding(pass, name);
        EXPECT_EQ(b.offset, next * row_bytes) << name;
        EXPECT_EQ(b.offset % limits.offset_alignment, 0u) << name;
        EXPECT_LE(b.bytes, limits.max_storage_range) << name;
        EXPECT_EQ(b.bytes, pushed(pass, "rows") * row_bytes) << name;
        next += pushed(pass, "rows");
    }
    EXPECT_EQ(next, rows) << name;
}

TEST(graph_slice, lays_the_lanes_of_a_tile_where_fewest_outputs_are_computed_for_nothing)
{
    struct Case {
        uint32_t rows, cols, across, groups_x, groups_y;
    };
    for (const Case c : {Case{4096, 16, 1, 32, 1},
                         {4096, 24, 2, 64, 1},
                         {4096, 48, 1, 32, 3},
                         {4096, 96, 2, 64, 3},
                         {4096, 192, 4, 128, 3},
                         {1, 384, 8, 1, 3},
                         {32, 64, 4, 1, 1}}) {
        SCOPED_TRACE(fmt::format("{} x {}", c.rows, c.cols));
        DeviceLimits limits = test_limits();
        limits.type = DeviceType::cpu;
        Graph g(limits);
        (void)gemm(g, fake_external(g, c.rows, 64), fake_external(g, c.cols, 64), {});
        const Plan plan = planned(g);
        ASSERT_EQ(plan.passes.size(), 1u);
        const Pass& pass = plan.passes[0];
        ASSERT_EQ(pass.variant->name, "cpu");
        EXPECT_EQ(pushed(pass, "col_lanes"), c.across);
        EXPECT_EQ(pass.group_count[0], c.groups_x);
        EXPECT_EQ(pass.group_count[1], c.groups_y);
    }
}

TEST(graph_slice, cuts_rows_into_aligned_bands_that_cover_each_row_once)
{
    for (auto [rows, cols] : {std::array{1000u, 64u}, {3001u, 8u}, {4099u, 24u}, {333u, 200u}, {70u, 1000u}}) {
        SCOPED_TRACE(fmt::format("{} x {}", rows, cols));
        DeviceLimits limits = test_limits();
        limits.max_storage_range = 1 << 15;
        limits.offset_alignment = 256;
        limits.max_storage_range = std::max<uint64_t>(limits.max_storage_range, 64 * cols * 4);
        Graph g(limits);
        (void)gelu(g, fake_external(g, rows, cols));
        const Plan plan = planned(g);
        EXPECT_GT(plan.passes.size(), 1u);
        EXPECT_EQ(plan.levels, 1u); // bands touch different rows
        for (const char* name : {"X", "Y"})
            expect_bands(plan, name, rows, uint64_t(cols) * 4, limits);
    }
}

TEST(graph_slice, cuts_a_fused_gemm_in_every_operand_that_has_rows)
{
    DeviceLimits limits = test_limits();
    limits.max_storage_range = 1 << 16;
    Graph g(limits);
    const uint32_t rows = 1000;
    const Tensor x = fake_external(g, rows, 64), w = fake_external(g, 64, 64), residual = fake_external(g, rows, 64);
    const Modulation gate{fake_external(g, 3, 64), fake_array(g, rows)};
    (void)gated_add(g, gelu(g, gemm(g, x, w, {}, {.dtype = DType::f32})), gate, residual);
    const Plan plan = planned(g);
    EXPECT_EQ(plan.fused, 2u);
    EXPECT_EQ(plan.passes.size(), 4u); // 256 rows each, whole tiles
    for (const char* name : {"X", "Residual", "Y"})
        expect_bands(plan, name, rows, 256, limits);
    expect_bands(plan, "GateRow", rows, 4, limits);
    for (const Pass& pass : plan.passes) {
        EXPECT_EQ(binding(pass, "W").offset, 0u);
        EXPECT_EQ(pass.group_count[0], divide_up(pushed(pass, "rows"), pass.grid.tile.rows));
    }
}

TEST(graph_slice, takes_rows_that_fit_even_where_a_tile_of_them_does_not)
{
    DeviceLimits limits = test_limits();
    limits.max_storage_range = 24 * 1024 * 4; // less than one tile of 32 rows
    Graph g(limits);
    const Tensor x = fake_external(g, 200, 1024), w = fake_external(g, 8, 1024);
    (void)gemm(g, x, w, {}, {.dtype = DType::f32});
    const Plan plan = planned(g);
    EXPECT_EQ(plan.passes.size(), 9u);
    expect_bands(plan, "X", 200, 4096, limits);
    expect_bands(plan, "Y", 200, 32, limits);
}

TEST(graph_slice, counts_texels_as_the_cpu_variant_binds_them)
{
    DeviceLimits limits = test_limits();
    limits.type = DeviceType::cpu;
    limits.max_texel_elements = 24 * 64 / 4; // w, and 24 rows of x
    Graph g(limits);
    const Tensor x = fake_external(g, 96, 64), w = fake_external(g, 24, 64);
    (void)gemm(g, x, w, {}, {.dtype = DType::f32});
    const Plan plan = planned(g);
    EXPECT_EQ(plan.passes.front().variant->name, "cpu");
    EXPECT_EQ(plan.passes.size(), 4u);
}

TEST(graph_slice, folds_workgroups_beyond_a_dimension_over_y)
{
    DeviceLimits limits = test_limits();
    limits.max_groups = 60;
    Graph g(limits);
    const Tensor x = fake_external(g, 1000, 64); // 8000 threads of 8 elements, 125 groups
    (void)gelu(g, x);
    (void)modulate(g, x, {fake_external(g, 1, 128), fake_array(g, 1000)}, 64, 1e-6f); // 250 groups of 4 rows
    const Plan plan = planned(g);
    EXPECT_EQ(plan.passes[0].group_count[0], 42u);
    EXPECT_EQ(plan.passes[0].group_count[1], 3u);
    EXPECT_EQ(plan.passes[1].group_count[0], 50u);
    EXPECT_EQ(plan.passes[1].group_count[1], 5u);
}

} // namespace graph_slice_test
} // namespace semrover
