// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>
#include <numbers>

namespace semrover {
namespace kernel_gemm_test {

struct GemmCase {
    uint32_t rows = 1, cols = 1, depth = 1, groups = 1;
    bool bias = true, gelu = false, gate = false;
};

// one element; a row of one; aligned; odd tails everywhere; two groups; more than one tile of every variant
const GemmCase kCases[] = {
    {.rows = 1, .cols = 1, .depth = 1, .bias = false},
    {.rows = 1, .cols = 64, .depth = 8},
    {.rows = 24, .cols = 64, .depth = 64},
    {.rows = 25, .cols = 65, .depth = 9, .gelu = true},
    {.rows = 77, .cols = 41, .depth = 60, .gate = true},
    {.rows = 50, .cols = 72, .depth = 48, .groups = 2, .gate = true},
    {.rows = 37, .cols = 120, .depth = 120, .groups = 2, .gelu = true},
    {.rows = 131, .cols = 200, .depth = 264, .gelu = true, .gate = true},
    {.rows = 1090, .cols = 500, .depth = 24, .gelu = true, .gate = true},
};

double gelu_reference(double v)
{
    return 0.5 * v * (1 + std::tanh(std::sqrt(2 / std::numbers::pi) * (v + 0.044715 * v * v * v)));
}

// whole blocks of K: one, two with odd tails, groups, as many as a texel has scales of and more
const GemmCase kBlockCases[] = {
    {1, 1, 32, 1, false, false, false},     {25, 65, 64, 1, true, true, false}, {50, 72, 96, 2, true, false, true},
    {37, 120, 256, 1, false, false, false}, {77, 41, 544, 1, true, true, true}, {1090, 500, 288, 1, true, false, false},
};

void check(Device& device, const GemmCase& c, DType dtype, DType w_dtype)
{
    SCOPED_TRACE(fmt::format("{}x{}x{} groups {} {} {}", c.rows, c.cols, c.depth, c.groups, dtype_name(dtype),
                             dtype_name(w_dtype)));
    KernelCase k(device);
    const uint32_t rows = c.rows * c.groups;
    const HostMatrix x = k.random(rows, c.depth, dtype), w = k.random(c.cols * c.groups, c.depth, w_dtype);
    const HostMatrix bias = k.random(c.groups, c.cols, DType::f32), residual = k.random(rows, c.cols, dtype);
    const uint32_t step = c.cols + 3, times = 3;
    const HostMatrix table = k.random(times, 5 + step * c.groups + 8, DType::f32);
    const std::vector<uint32_t> table_row = k.indices(rows, times);

    Tensor y =
        gemm(k.graph, k.input(x), k.input(w), c.bias ? k.input(bias) : Tensor{}, {.groups = c.groups, .dtype = dtype});
    if (c.gelu)
        y = gelu(k.graph, y);
    if (c.gate)
        y = gated_add(k.graph, y, {k.input(table), k.input(table_row), 5, step}, k.input(residual), c.groups);
    const HostMatrix got = k.run(y);
    // matrix units take fp16: others are rounded to it
    const bool rounded = w_dtype != DType::f16 && k.plan().passes[0].variant->name == "coopmat";

    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t n = 0; n < c.cols; ++n) {
            const uint32_t group = r / c.rows;
            double sum = 0, magnitude = 0;
            for (uint32_t d = 0; d < c.depth; ++d) {
                const double term = double(x.at(r, d)) * w.at(group * c.cols + n, d);
                sum += term;
                magnitude += std::abs(term);
            }
            double v = sum + (c.bias ? bias.at(group, n) : 0);
            if (c.gelu)
                v = gelu_reference(v);
            if (c.gate)
                v = residual.at(r, n) + table.at(table_row[r], 5 + group * step + n) * v;
            const double tolerance = 1e-6 * (magnitude + 4) + (dtype == DType::f16 ? 6e-4 * std::abs(v) : 0) +
                                     (rounded ? 4.9e-4 * magnitude : 0);
            ASSERT_NEAR(got.at(r, n), v, tolerance) << "row " << r << " column " << n;
        }
    k.expect_zero_padding(got);
}

TEST(kernel_gemm, matches_a_sum_in_double_with_every_epilogue)
{
    for (const GemmCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(test_device(), c, dtype, dtype);
}

TEST(kernel_gemm, takes_weights_of_another_type_than_its_input)
{
    for (const GemmCase& c : kBlockCases)
        for (DType dtype : {DType::f32, DType::f16})
            check(test_device(), c, dtype, DType::q8_0);
    check(test_device(), kCases[3], DType::f32, DType::f16);
    check(test_device(), kCases[3], DType::f16, DType::f32);
}

// an int8 times an fp16 scale is exact in fp32
TEST(kernel_gemm, gives_the_bits_of_the_numbers_that_blocks_stand_for)
{
    KernelCase k(test_device()), plain(test_device());
    const HostMatrix x = k.random(70, 544, DType::f32), w = k.random(90, 544, DType::q8_0);
    HostMatrix numbers(w.rows, w.cols, DType::f32);
    numbers.values = w.values;
    const HostMatrix y = k.run(gemm(k.graph, k.input(x), k.input(w), {}, {.dtype = DType::f32}));
    EXPECT_EQ(y.values,
              plain.run(gemm(plain.graph, plain.input(x), plain.input(numbers), {}, {.dtype = DType::f32})).values);
}

TEST(kernel_gemm, epilogues_are_fused_into_one_pass)
{
    KernelCase k(test_device());
    const HostMatrix x = k.random(16, 16, DType::f32), w = k.random(16, 16, DType::f32);
    const HostMatrix table = k.random(1, 16, DType::f32);
    const Tensor h = gelu(k.graph, gemm(k.graph, k.input(x), k.input(w), {}, {.dtype = DType::f32}));
    const Tensor y = gated_add(k.graph, h, {k.input(table), k.input(std::vector<uint32_t>(16, 0))}, k.input(x));
    (void)k.run(y);
    EXPECT_EQ(k.plan().passes.size(), 1u);
    EXPECT_EQ(k.plan().fused, 2u);
}

// with so many rows and columns, a tile of GPUs is larger than with two rows
TEST(kernel_gemm, gives_a_row_the_same_bits_wherever_it_stands)
{
    constexpr uint32_t kDepth = 120;
    for (const auto& [rows, cols] : {std::pair(1100u, 520u), std::pair(2200u, 2000u)})
        for (DType dtype : {DType::f32, DType::f16}) {
            KernelCase k(test_device()), alone(test_device());
            const HostMatrix x = k.random(rows, kDepth, dtype), w = k.random(cols, kDepth, dtype);
            const HostMatrix all = k.run(gemm(k.graph, k.input(x), k.input(w), {}, {.dtype = dtype}));
            HostMatrix chosen(2, kDepth, dtype);
            for (uint32_t c = 0; c < kDepth; ++c) {
                chosen.set(0, c, x.at(130, c));
                chosen.set(1, c, x.at(47, c));
            }
            const HostMatrix two =
                alone.run(gemm(alone.graph, alone.input(chosen), alone.input(w), {}, {.dtype = dtype}));
            for (uint32_t c = 0; c < cols; ++c) {
                ASSERT_EQ(two.at(0, c), all.at(130, c));
                ASSERT_EQ(two.at(1, c), all.at(47, c));
            }
        }
}

} // namespace kernel_gemm_test
} // namespace semrover
