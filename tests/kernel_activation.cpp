// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>
#include <numbers>

namespace semrover {
namespace kernel_activation_test {

// one element; aligned; odd tails; large
constexpr std::pair<uint32_t, uint32_t> kShapes[] = {{1, 1}, {8, 64}, {7, 61}, {25, 65}, {14, 1301}, {1000, 130}};

double gelu_reference(double v)
{
    return 0.5 * v * (1 + std::tanh(std::sqrt(2 / std::numbers::pi) * (v + 0.044715 * v * v * v)));
}
double silu_reference(double v)
{
    return v / (1 + std::exp(-v));
}

void check(Tensor (*op)(Graph&, Tensor), double (*reference)(double), uint32_t rows, uint32_t cols, DType dtype)
{
    SCOPED_TRACE(fmt::format("[{}, {}] {}", rows, cols, dtype_name(dtype)));
    KernelCase k(test_device());
    HostMatrix x = k.random(rows, cols, dtype, 3);
    x.set(0, 0, -65504); // the ends of fp16 and of the exponential
    x.set(rows - 1, cols - 1, 65504);
    x.set(0, cols / 2, 88.9f);
    x.set(rows / 2, cols / 3, -88.9f);
    const HostMatrix y = k.run(op(k.graph, k.input(x)));
    for (uint32_t r = 0; r < rows; ++r)
        for (uint32_t c = 0; c < cols; ++c) {
            const double v = reference(x.at(r, c));
            // half a unit in the last place of an fp16 result, a little widened; 3e-8 is half the smallest number
            const double half_error = dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 0;
            ASSERT_NEAR(y.at(r, c), v, 1e-6 * (1 + std::abs(v)) + half_error) << "at " << x.at(r, c);
        }
    k.expect_zero_padding(y);
}

TEST(kernel_gelu, matches_its_formula_in_double)
{
    for (const auto& [rows, cols] : kShapes)
        for (DType dtype : {DType::f32, DType::f16})
            check(gelu, gelu_reference, rows, cols, dtype);
}

TEST(kernel_silu, matches_its_formula_in_double)
{
    for (const auto& [rows, cols] : kShapes)
        for (DType dtype : {DType::f32, DType::f16})
            check(silu, silu_reference, rows, cols, dtype);
}

TEST(kernel_relu, cuts_at_zero_and_leaves_the_padding_zero)
{
    for (const auto& [rows, cols] : kShapes)
        for (DType dtype : {DType::f32, DType::f16}) {
            KernelCase k(test_device());
            const HostMatrix x = k.random(rows, cols, dtype);
            const HostMatrix y = k.run(relu(k.graph, k.input(x)));
            for (uint32_t r = 0; r < rows; ++r)
                for (uint32_t c = 0; c < cols; ++c)
                    ASSERT_EQ(y.at(r, c), std::max(x.at(r, c), 0.f));
            k.expect_zero_padding(y);
        }
}

TEST(kernel_relu, runs_in_the_epilogue_of_a_gemm)
{
    for (const auto& [rows, outputs] : {std::pair{1u, 1u}, {33u, 70u}, {200u, 128u}}) {
        KernelCase k(test_device());
        const HostMatrix x = k.random(rows, 19, DType::f32), w = k.random(outputs, 19, DType::f32);
        const HostMatrix bias = k.random(1, outputs, DType::f32);
        const Tensor product = gemm(k.graph, k.input(x), k.input(w), k.input(bias), {.dtype = DType::f32});
        const HostMatrix y = k.run(relu(k.graph, product));
        EXPECT_EQ(k.plan().passes.size(), 1u);
        for (uint32_t r = 0; r < rows; ++r)
            for (uint32_t n = 0; n < outputs; ++n) {
                double sum = bias.at(0, n);
                for (uint32_t c = 0; c < 19; ++c)
                    sum += double(x.at(r, c)) * w.at(n, c);
                ASSERT_NEAR(y.at(r, n), std::max(sum, 0.), 2e-5);
            }
    }
}

} // namespace kernel_activation_test
} // namespace semrover
