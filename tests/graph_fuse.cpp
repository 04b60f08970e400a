// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_fuse_test {

// externals of one shape, and ops on them
struct FuseCase {
    Graph g{test_limits()};
    Tensor x = fake_external(g, 16, 64), w = fake_external(g, 64, 64), residual = fake_external(g, 16, 64);

    Tensor product() { return gemm(g, x, w, {}, {.dtype = DType::f32}); }
    Tensor gated(Tensor t, Tensor onto) { return gated_add(g, t, {fake_external(g, 3, 64), fake_array(g, 16)}, onto); }
    std::string levels()
    {
        auto plan = make_plan(g);
        EXPECT_TRUE(plan) << plan.error().message;
        return plan ? levels_text(*plan) : "";
    }
};

TEST(graph_fuse, moves_each_epilogue_into_the_gemm)
{
    for (int op = 0; op < 4; ++op) {
        FuseCase c;
        const Tensor t = c.product();
        (void)(op == 0   ? gelu(c.g, t)
               : op == 1 ? silu(c.g, t)
               : op == 2 ? add(c.g, t, c.residual)
                         : c.gated(t, c.residual));
        EXPECT_EQ(c.levels(), "gemm");
    }
}

TEST(graph_fuse, moves_chains_in_the_order_that_the_shader_applies)
{
    FuseCase c;
    (void)c.gated(gelu(c.g, c.product()), c.residual);
    EXPECT_EQ(c.levels(), "gemm");
    FuseCase d;
    (void)add(d.g, silu(d.g, d.product()), d.residual);
    EXPECT_EQ(d.levels(), "gemm");
}

TEST(graph_fuse, stops_where_the_order_is_another)
{
    FuseCase c;
    (void)gelu(c.g, add(c.g, c.product(), c.residual));
    EXPECT_EQ(c.levels(), "gemm | gelu");
    FuseCase d;
    (void)gelu(d.g, gelu(d.g, d.product()));
    EXPECT_EQ(d.levels(), "gemm | gelu");
}

TEST(graph_fuse, stops_at_a_second_residual)
{
    FuseCase c;
    (void)add(c.g, c.gated(c.product(), c.residual), c.x);
    EXPECT_EQ(c.levels(), "gemm | add");
}

TEST(graph_fuse, keeps_a_value_that_a_second_pass_reads)
{
    FuseCase c;
    const Tensor t = c.product();
    const Tensor a = gelu(c.g, t), b = silu(c.g, t);
    (void)add(c.g, a, b);
    EXPECT_EQ(c.levels(), "gemm | gelu silu | add");
}

TEST(graph_fuse, keeps_a_value_that_the_consumer_reads_twice)
{
    FuseCase c;
    const Tensor t = c.product();
    (void)add(c.g, t, t);
    EXPECT_EQ(c.levels(), "gemm | add");
}

TEST(graph_fuse, keeps_a_value_that_is_an_output)
{
    FuseCase c;
    (void)gelu(c.g, c.g.keep(gemm(c.g, c.x, c.w, {}, {.dtype = DType::f32}), c.residual));
    EXPECT_EQ(c.levels(), "gemm | gelu");
}

TEST(graph_fuse, keeps_a_value_of_which_only_a_part_is_read)
{
    FuseCase c;
    (void)gelu(c.g, c.product().row_range(8, 8));
    EXPECT_EQ(c.levels(), "gemm | gelu");
}

TEST(graph_fuse, does_not_move_a_read_before_its_write)
{
    FuseCase c;
    const Tensor t = c.product(), late = gelu(c.g, c.x);
    (void)add(c.g, t, late);
    EXPECT_EQ(c.levels(), "gemm gelu | add");
    FuseCase d; // the same through two names of one memory
    const BufferSlice memory = fake_memory(16 * 64 * 4);
    const Tensor written = d.g.external(memory, 16, 64, DType::f32, "a"),
                 read = d.g.external(memory, 16, 64, DType::f32, "b");
    const Tensor u = d.product();
    add(d.g, d.x, d.x, {written});
    (void)add(d.g, u, read);
    EXPECT_EQ(d.levels(), "gemm add | add");
}

TEST(graph_fuse, does_not_let_a_gemm_overwrite_what_its_other_tiles_still_read)
{
    FuseCase c;
    add(c.g, c.product(), c.residual, {c.x});
    EXPECT_EQ(c.levels(), "gemm | add");
    FuseCase d;
    add(d.g, d.product(), d.residual, {d.residual}); // element by element in place: that is fine
    EXPECT_EQ(d.levels(), "gemm");
}

TEST(graph_fuse, cuts_a_fused_pass_in_all_its_bindings_or_not_at_all)
{
    DeviceLimits limits = test_limits();
    limits.max_storage_range = 16384; // half of each
    Graph g(limits);
    const Tensor x = fake_external(g, 128, 64), w = fake_external(g, 128, 64), residual = fake_external(g, 128, 64);
    (void)add(g, gemm(g, x, w, {}, {.groups = 2, .dtype = DType::f32}), residual);
    const auto plan = make_plan(g);
    ASSERT_FALSE(plan); // two groups lie one after the other: no band of rows serves both
    EXPECT_EQ(plan.error().code, ErrorCode::out_of_memory) << plan.error().message;
}

} // namespace graph_fuse_test
} // namespace semrover
