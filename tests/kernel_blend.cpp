// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

namespace semrover {
namespace kernel_blend_test {

TEST(kernel_blend, goes_the_share_of_the_way_from_x_to_z_and_leaves_the_padding_zero)
{
    for (const auto& [rows, cols] : {std::pair{1u, 1u}, {8u, 64u}, {7u, 61u}, {1000u, 130u}})
        for (DType dtype : {DType::f32, DType::f16})
            for (const float share : {0.f, 0.3125f, 1.f}) {
                KernelCase k(test_device());
                const HostMatrix x = k.random(rows, cols, dtype), z = k.random(rows, cols, dtype);
                HostMatrix part(1, 1, DType::f32);
                part.set(0, 0, share);
                const HostMatrix y = k.run(blend(k.graph, k.input(x), k.input(z), k.input(part)));
                for (uint32_t r = 0; r < rows; ++r)
                    for (uint32_t c = 0; c < cols; ++c) {
                        const double expected = x.at(r, c) + double(share) * (double(z.at(r, c)) - x.at(r, c));
                        // two roundings of fp32 numbers as large as the difference, then one of what is stored
                        const double size = std::abs(x.at(r, c)) + std::abs(z.at(r, c));
                        const double stored = dtype == DType::f16 ? 4.9e-4 * std::abs(expected) + 3e-8 : 0;
                        ASSERT_NEAR(y.at(r, c), expected, 2e-7 * size + stored);
                    }
                k.expect_zero_padding(y);
            }
}

} // namespace kernel_blend_test
} // namespace semrover
