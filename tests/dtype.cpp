// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/dtype.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <limits>

namespace semrover {
namespace dtype_test {

TEST(DType, every_half_is_the_number_it_says_and_comes_back)
{
    for (uint32_t h = 0; h < 65536; ++h) {
        const int exponent = int(h >> 10 & 31), mantissa = int(h & 1023);
        double expected = exponent == 0    ? std::ldexp(mantissa, -24)
                          : exponent == 31 ? (mantissa ? NAN : INFINITY)
                                           : std::ldexp(1024 + mantissa, exponent - 25);
        if (h & 0x8000)
            expected = -expected;
        const float got = half_to_float(uint16_t(h));
        if (std::isnan(expected)) {
            EXPECT_TRUE(std::isnan(got)) << h;
            continue;
        }
        EXPECT_EQ(double(got), expected) << h;
        EXPECT_EQ(float_to_half(got), h);
    }
}

TEST(DType, bf16_is_the_upper_half_of_a_float_rounded_to_even)
{
    for (uint32_t b = 0; b < 65536; ++b)
        if (!std::isnan(bf16_to_float(uint16_t(b)))) {
            EXPECT_EQ(float_to_bf16(bf16_to_float(uint16_t(b))), b);
        }
    EXPECT_EQ(float_to_bf16(1 + 0x1p-8f), 0x3f80);            // a tie, down to even
    EXPECT_EQ(float_to_bf16(1 + 3 * 0x1p-8f), 0x3f82);        // a tie, up to even
    EXPECT_EQ(float_to_bf16(1 + 0x1p-8f + 0x1p-20f), 0x3f81); // above the tie
    EXPECT_EQ(float_to_bf16(std::numeric_limits<float>::max()), 0x7f80);
    EXPECT_TRUE(std::isnan(bf16_to_float(float_to_bf16(NAN))));
}

} // namespace dtype_test
} // namespace semrover
