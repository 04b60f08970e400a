// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/graph_memory.h"

#include <gtest/gtest.h>

namespace semrover {
namespace graph_misuse_test {

// the error of a graph that must not compile
Error error_of(const Graph& g)
{
    auto plan = make_plan(g);
    EXPECT_FALSE(plan);
    return plan ? Error{} : plan.error();
}

TEST(graph_misuse, names_pass_and_tensor_that_is_read_before_it_is_written)
{
    Graph g(test_limits());
    (void)gelu(g, fake_external(g, 16, 64));
    (void)silu(g, g.matrix(16, 64, DType::f32, "nowhere"));
    const Error e = error_of(g);
    EXPECT_EQ(e.code, ErrorCode::internal);
    EXPECT_EQ(e.message, "pass 1 (activation): binding X reads 'nowhere', which nothing has written");
}

TEST(graph_misuse, names_a_tensor_whose_type_a_shader_does_not_take)
{
    Graph g(test_limits());
    (void)gelu(g, fake_external(g, 16, 64, DType::bf16, "activations"));
    EXPECT_EQ(error_of(g).message, "pass 0 (activation): binding X does not take BF16, the type of 'activations'");
    Graph h(test_limits());
    (void)gemm(h, fake_external(h, 16, 64), fake_external(h, 8, 64, DType::bf16, "weight"), {}, {.dtype = DType::f32});
    EXPECT_EQ(error_of(h).message, "pass 0 (gemm): binding W does not take BF16, the type of 'weight'");
    Graph k(test_limits()); // a binding that leaves no choice
    const Tensor index = k.external(fake_memory(256), 16, 1, DType::f16, "indices", 1);
    (void)embedding(k, index, fake_external(k, 16, 64), {}, DType::f32);
    EXPECT_EQ(error_of(k).message, "pass 0 (embedding): binding Index does not take F16, the type of 'indices'");
}

TEST(graph_misuse, wants_every_byte_written_that_is_read)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64), half = g.matrix(32, 64, DType::f32, "half");
    add(g, x, x, {half, 16});
    (void)gelu(g, half);
    EXPECT_EQ(error_of(g).message, "pass 1 (activation): binding X reads 'half', which nothing has written");
    Graph whole(test_limits());
    const Tensor y = fake_external(whole, 16, 64), both = whole.matrix(32, 64, DType::f32, "both");
    add(whole, y, y, {both, 16});
    add(whole, y, y, {both, 0});
    (void)gelu(whole, both);
    EXPECT_TRUE(make_plan(whole));
}

TEST(graph_misuse, names_a_range_that_leaves_its_tensor)
{
    Graph g(test_limits());
    const Tensor x = fake_external(g, 16, 64, DType::f32, "small");
    (void)gelu(g, x.row_range(10, 16));
    EXPECT_EQ(error_of(g).message, "pass 0 (activation): binding X reaches byte 6656 of 'small', which has 4096");
    Graph h(test_limits());
    const Tensor y = h.matrix(16, 64, DType::f32, "target"), z = fake_external(h, 16, 64);
    add(h, z, z, {y, 1});
    EXPECT_EQ(error_of(h).message, "pass 0 (add): binding Y reaches byte 4352 of 'target', which has 4096");
}

TEST(graph_misuse, refuses_a_tensor_larger_than_an_allocation_with_numbers)
{
    DeviceLimits limits = test_limits();
    limits.max_allocation = 512 << 20;
    Graph g(limits);
    (void)gelu(g, fake_external(g, 1 << 20, 512));
    const Error e = error_of(g);
    EXPECT_EQ(e.code, ErrorCode::out_of_memory);
    EXPECT_EQ(e.message, "tensor 'gelu' of 2147483648 bytes exceeds the device's largest allocation of 536870912");
}

TEST(graph_misuse, refuses_a_binding_that_cannot_be_cut_with_numbers)
{
    DeviceLimits limits = test_limits();
    limits.max_storage_range = 1 << 19;
    Graph g(limits);
    const Tensor x = fake_external(g, 8, 64), w = fake_external(g, 4096, 64, DType::f32, "weight");
    (void)gemm(g, x, w, {}, {.dtype = DType::f32});
    const Error e = error_of(g);
    EXPECT_EQ(e.code, ErrorCode::out_of_memory);
    EXPECT_EQ(e.message, "gemm: binding W ('weight') has 1048576 bytes; this device binds at most 524288");
}

TEST(graph_misuse, refuses_rows_that_do_not_fit_a_binding_one_by_one)
{
    DeviceLimits limits = test_limits();
    limits.max_storage_range = 1 << 16;
    Graph g(limits);
    (void)gelu(g, fake_external(g, 4, 40000, DType::f32, "wide"));
    const Error e = error_of(g);
    EXPECT_EQ(e.code, ErrorCode::out_of_memory);
    EXPECT_EQ(e.message, "activation: 1 rows of binding X ('wide') are 160000 bytes; this device binds at most 65536");
}

TEST(graph_misuse, names_the_kernel_that_no_variant_of_runs)
{
    DeviceLimits limits = test_limits();
    limits.max_group_threads = 16;
    Graph g(limits);
    (void)gelu(g, fake_external(g, 4, 64));
    const Error e = error_of(g);
    EXPECT_EQ(e.code, ErrorCode::no_device);
    EXPECT_EQ(
        e.message,
        "no variant of kernel 'activation' runs on this device (16384 bytes of shared memory, 16 threads a group, "
        "16 storage buffers a shader)");
    limits = test_limits();
    limits.max_storage_buffers = 1; // x and y are two
    Graph one(limits);
    (void)gelu(one, fake_external(one, 4, 64));
    EXPECT_EQ(error_of(one).code, ErrorCode::no_device);
    limits.max_storage_buffers = 2;
    Graph two(limits);
    (void)gelu(two, fake_external(two, 4, 64));
    EXPECT_TRUE(make_plan(two));
}

TEST(graph_misuse, refuses_more_workgroups_than_both_dimensions_take)
{
    DeviceLimits limits = test_limits();
    limits.max_groups = 8;
    Graph g(limits);
    (void)gelu(g, fake_external(g, 1000, 64));
    const Error e = error_of(g);
    EXPECT_EQ(e.code, ErrorCode::out_of_memory);
    EXPECT_EQ(e.message, "activation: 16 workgroups in dimension 1, the device takes 1..8");
}

using graph_misuse_death = testing::Test;

TEST(graph_misuse_death, stops_at_shapes_that_do_not_meet)
{
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    Graph g(test_limits());
    const Tensor x = fake_external(g, 4, 64), y = fake_external(g, 5, 64), w = fake_external(g, 8, 32);
    EXPECT_DEATH((void)add(g, x, y), "add: \\[4, 64\\] onto \\[5, 64\\]");
    EXPECT_DEATH((void)gemm(g, x, w, {}), "gemm: x \\[4, 64\\] F32 and w \\[8, 32\\] F32");
    EXPECT_DEATH((void)g.matrix(0, 4, DType::f32, "void"), "tensor 'void' is empty: 0 x 4");
    EXPECT_DEATH((void)gelu(g, Tensor{77, DType::f32, 4, 64, 64}), "a tensor of another graph");
    EXPECT_DEATH((void)g.external(fake_memory(100), 4, 64, DType::f32, "short"), "'short' of 1024 bytes in 100 bytes");
}

} // namespace graph_misuse_test
} // namespace semrover
