// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/kernel_case.h"

namespace semrover {
namespace kernel_relu_test {

TEST(kernel_relu, cuts_at_zero_and_leaves_the_padding_zero)
{
    for (const auto& [rows, cols] : {std::pair{1u, 1u}, {8u, 64u}, {7u, 61u}, {1000u, 130u}})
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

} // namespace kernel_relu_test
} // namespace semrover
