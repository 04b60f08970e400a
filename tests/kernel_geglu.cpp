// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_geglu_test {

double gelu_exact(double v)
{
    return 0.5 * v * (1 + std::erf(v / std::sqrt(2.0)));
}

// got = h gelu(gate), of the blocks of x
void expect_geglu(const HostMatrix& got, const HostMatrix& x, DType dtype)
{
    for (uint32_t r = 0; r < got.rows; ++r)
        for (uint32_t c = 0; c < got.cols; ++c) {
            const double h = x.at(r, c / 8 * 16 + c % 8), gate = x.at(r, c / 8 * 16 + 8 + c % 8);
            const double v = h * gelu_exact(gate);
            const double tolerance = 3e-7 * (std::abs(h * gate) + 1) + (dtype == DType::f16 ? 6e-4 * std::abs(v) : 0);
            ASSERT_NEAR(got.at(r, c), v, tolerance) << "row " << r << " column " << c << " h " << h << " gate " << gate;
        }
}

TEST(kernel_geglu, matches_the_exact_erf)
{
    for (const auto& [rows, cols] : {std::pair{1u, 8u}, std::pair{25u, 72u}, std::pair{131u, 1280u}})
        for (DType dtype : {DType::f32, DType::f16}) {
            KernelCase k(test_device());
            const HostMatrix x = k.random(rows, 2 * cols, dtype, 3);
            const HostMatrix got = k.run(geglu(k.graph, k.input(x)));
            expect_geglu(got, x, dtype);
        }
}

TEST(kernel_geglu, runs_in_the_epilogue_of_a_gemm)
{
    for (const auto& [rows, cols] :
         {std::pair{1u, 8u}, std::pair{37u, 40u}, std::pair{131u, 104u}, std::pair{1030u, 264u}})
        for (DType dtype : {DType::f32, DType::f16}) {
            KernelCase k(test_device()), apart(test_device());
            const HostMatrix x = k.random(rows, 56, dtype), w = k.random(2 * cols, 56, dtype, 0.2f);
            const HostMatrix bias = k.random(1, 2 * cols, DType::f32);
            const HostMatrix got =
                k.run(geglu(k.graph, gemm(k.graph, k.input(x), k.input(w), k.input(bias), {.dtype = dtype})));
            EXPECT_EQ(k.plan().passes.size(), 1u);
            // the same in two passes, with a product in fp32 between them
            const HostMatrix product =
                apart.run(gemm(apart.graph, apart.input(x), apart.input(w), apart.input(bias), {.dtype = DType::f32}));
            ASSERT_EQ(got.cols, cols);
            expect_geglu(got, product, dtype);
        }
}

} // namespace kernel_geglu_test
} // namespace semrover
