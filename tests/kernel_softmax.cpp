// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_softmax_test {

// in double; logits far from zero, as only their differences count
TEST(kernel_softmax, matches_a_sum_in_double_and_leaves_zeros_behind)
{
    for (const auto& [rows, cols, count] : {std::array{1u, 1u, 1u}, {3u, 16u, 5u}, {17u, 77u, 77u}, {5u, 1300u, 1027u}})
        for (const DType x_dtype : {DType::f32, DType::f16})
            for (const DType dtype : {DType::f32, DType::f16}) {
                SCOPED_TRACE(
                    fmt::format("{} of {} x {} {} {}", count, rows, cols, dtype_name(x_dtype), dtype_name(dtype)));
                KernelCase k(test_device());
                HostMatrix x = k.random(rows, cols, x_dtype, 20);
                for (uint32_t r = 0; r < rows; ++r)
                    for (uint32_t c = 0; c < cols; ++c)
                        x.set(r, c, x.at(r, c) + (r % 2 ? 300.f : -300.f));
                const HostMatrix got = k.run(softmax(k.graph, k.input(x), {count, 0.37f, dtype}));
                for (uint32_t r = 0; r < rows; ++r) {
                    double most = -1e30, sum = 0;
                    for (uint32_t c = 0; c < count; ++c)
                        most = std::max(most, 0.37f * double(x.at(r, c)));
                    for (uint32_t c = 0; c < count; ++c)
                        sum += std::exp(0.37f * double(x.at(r, c)) - most);
                    for (uint32_t c = 0; c < cols; ++c) {
                        const double v = c < count ? std::exp(0.37f * double(x.at(r, c)) - most) / sum : 0;
                        ASSERT_NEAR(got.at(r, c), v, dtype == DType::f16 ? 1e-3 * v + 6e-8 : 3e-5 * v + 1e-9)
                            << r << ", " << c;
                    }
                }
                k.expect_zero_padding(got);
            }
}

} // namespace kernel_softmax_test
} // namespace semrover
