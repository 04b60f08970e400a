// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/kernel_case.h"

#include <cmath>

namespace semrover {
namespace {

struct NormCase {
    uint32_t rows, cols;
};
// one texel; odd tails; the networks' widths; rows longer than one sweep of a workgroup; more rows than a tile
const NormCase kCases[] = {{1, 8}, {3, 65}, {25, 320}, {9, 768}, {130, 1280}, {2, 10240}};
constexpr float kEps = 1e-5f;

double normed(const HostMatrix& x, uint32_t row, uint32_t col, double weight, double bias)
{
    double mean = 0, variance = 0;
    for (uint32_t c = 0; c < x.cols; ++c)
        mean += x.at(row, c);
    mean /= x.cols;
    for (uint32_t c = 0; c < x.cols; ++c)
        variance += (x.at(row, c) - mean) * (x.at(row, c) - mean);
    return (x.at(row, col) - mean) / std::sqrt(variance / x.cols + kEps) * weight + bias;
}

TEST(kernel_layer_norm, matches_its_formula_in_double)
{
    for (const NormCase& c : kCases)
        for (DType dtype : {DType::f32, DType::f16}) {
            SCOPED_TRACE(fmt::format("[{}, {}] {}", c.rows, c.cols, dtype_name(dtype)));
            KernelCase k(test_device());
            HostMatrix x = k.random(c.rows, c.cols, dtype, 3);
            for (uint32_t n = 0; n < c.cols; ++n) // a mean to take out
                x.set(0, n, x.at(0, n) + 50);
            const HostMatrix weight = k.random(1, c.cols, DType::f32), bias = k.random(1, c.cols, DType::f32);
            const HostMatrix got = k.run(layer_norm(k.graph, k.input(x), k.input(weight), k.input(bias), kEps));
            for (uint32_t r = 0; r < c.rows; r += 1 + c.rows / 30)
                for (uint32_t n = 0; n < c.cols; n += 1 + c.cols / 900) {
                    const double v = normed(x, r, n, weight.at(0, n), bias.at(0, n));
                    const double half = dtype == DType::f16 ? 3e-8 + 6e-4 * std::abs(v) : 0;
                    ASSERT_NEAR(got.at(r, n), v, 2e-5 + half) << "row " << r << " column " << n;
                }
            k.expect_zero_padding(got);
        }
}

TEST(kernel_layer_norm, gives_the_bias_where_a_row_is_constant)
{
    KernelCase k(test_device());
    HostMatrix x(1, 72, DType::f32);
    for (uint32_t c = 0; c < x.cols; ++c)
        x.set(0, c, 2);
    const HostMatrix weight = k.random(1, 72, DType::f32), bias = k.random(1, 72, DType::f32);
    const HostMatrix got = k.run(layer_norm(k.graph, k.input(x), k.input(weight), k.input(bias), kEps));
    for (uint32_t c = 0; c < x.cols; ++c)
        ASSERT_EQ(got.at(0, c), bias.at(0, c));
}

} // namespace
} // namespace semrover
