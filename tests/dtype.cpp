// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/dtype.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <limits>
#include <vector>

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

template <typename T>
std::optional<uint64_t> first_bad(const std::vector<T>& values, DType dtype)
{
    return first_non_finite(std::as_bytes(std::span(values)), dtype);
}

TEST(FirstNonFinite, nan_and_infinity_are_found_in_every_float_type)
{
    const float inf = std::numeric_limits<float>::infinity(), most = std::numeric_limits<float>::max();
    EXPECT_EQ(first_bad<float>({1, most, -inf}, DType::f32), 2u);
    EXPECT_EQ(first_bad<float>({std::nanf("")}, DType::f32), 0u);
    EXPECT_EQ(first_bad<float>({1, -0.f, 1e-45f}, DType::f32), std::nullopt);
    EXPECT_EQ(first_bad<double>({1, std::nan("")}, DType::f64), 1u);
    EXPECT_EQ(first_bad<uint16_t>({0x7bff, 0xfbff}, DType::f16), std::nullopt);
    EXPECT_EQ(first_bad<uint16_t>({0x7bff, 0xfc00}, DType::f16), 1u);
    EXPECT_EQ(first_bad<uint16_t>({0x7f7f, 0x7fc0}, DType::bf16), 1u);
    EXPECT_EQ(first_bad<uint16_t>({0x7f7f, 0x7c00}, DType::bf16), std::nullopt);
    EXPECT_EQ(first_bad<uint32_t>({0xffffffff}, DType::u32), std::nullopt);
}

TEST(FirstNonFinite, the_first_of_several_is_found_wherever_it_is_in_a_large_tensor)
{
    std::vector<uint16_t> halves(20000, 0x7bff);
    EXPECT_EQ(first_bad(halves, DType::f16), std::nullopt);
    for (uint32_t at : {19999, 12289, 12288, 12287, 4096, 4095, 1}) {
        halves[at] = at % 2 ? 0x7c00 : 0xfe00;
        EXPECT_EQ(first_bad(halves, DType::f16), at);
    }
}

} // namespace dtype_test
} // namespace semrover
