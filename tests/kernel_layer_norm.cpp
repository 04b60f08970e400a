// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "tests/support/kernel_case.h"

#include <cmath>

namespace semrover {
namespace kernel_layer_norm_test {

// one element; aligned; odd tails; rows that registers keep a part of
constexpr std::pair<uint32_t, uint32_t> kCases[] = {{1, 1},    {3, 64},   {25, 65},  {24, 320},
                                                    {7, 1287}, {6, 1280}, {131, 520}};
constexpr float kEps = 1e-5f;

TEST(kernel_layer_norm, matches_two_passes_in_double)
{
    for (const auto& [rows, cols] : kCases)
        for (DType dtype : {DType::f32, DType::f16}) {
            SCOPED_TRACE(fmt::format("[{}, {}] {}", rows, cols, dtype_name(dtype)));
            KernelCase k(test_device());
            HostMatrix x = k.random(rows, cols, dtype);
            for (uint32_t c = 0; c < cols; ++c)
                x.set(0, c, x.at(0, c) + 100); // a mean far away
            const HostMatrix weight = k.random(1, cols, DType::f32), bias = k.random(1, cols, DType::f32);
            const HostMatrix got = k.run(layer_norm(k.graph, k.input(x), k.input(weight), k.input(bias), kEps));
            for (uint32_t r = 0; r < rows; ++r) {
                double mean = 0, variance = 0;
                for (uint32_t c = 0; c < cols; ++c)
                    mean += double(x.at(r, c)) / cols;
                for (uint32_t c = 0; c < cols; ++c)
                    variance += (x.at(r, c) - mean) * (x.at(r, c) - mean) / cols;
                for (uint32_t c = 0; c < cols; ++c) {
                    const double scale = weight.at(0, c) / std::sqrt(variance + kEps);
                    const double v = (x.at(r, c) - mean) * scale + bias.at(0, c);
                    // the mean of row 0 is rounded to 100 * 2^-24
                    const double tolerance = 4e-6 * (1 + std::abs(v)) + (r == 0 ? 3e-5 * std::abs(scale) : 0) +
                                             (dtype == DType::f16 ? 6e-4 * std::abs(v) : 0);
                    ASSERT_NEAR(got.at(r, c), v, tolerance) << "row " << r << " column " << c;
                }
            }
            k.expect_zero_padding(got);
        }
}

} // namespace kernel_layer_norm_test
} // namespace semrover
