// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// The nearest binary16 number, ties to even, inf from 65520 on. Vulkan lets packHalf2x16 round as it likes, and AMD's
// compilers round toward zero, which also makes overflow 65504. A number that fp16 holds is packed alike everywhere.
float nearest_half(float x)
{
    const uint sign = floatBitsToUint(x) & 0x80000000u;
    // 2^exponent, at least that of the smallest normal number: subnormals are as far apart
    const float binade = clamp(uintBitsToFloat(floatBitsToUint(x) & 0x7f800000u), 6.103515625e-5, 65536.0);
    precise float shifted = abs(x) + 8192.0 * binade; // no bits are left below fp16's
    precise float rounded = shifted - 8192.0 * binade;
    precise float overflowed = rounded * uintBitsToFloat(0x77800000u); // 2^112: 65536 becomes inf
    precise float nearest = overflowed * uintBitsToFloat(0x07800000u | sign);
    return nearest;
}

// of 0 <= x <= 1
float nearest_half_share(float x)
{
    const float step = 8192.0 * max(uintBitsToFloat(floatBitsToUint(x) & 0x7f800000u), 6.103515625e-5);
    precise float shifted = x + step;
    precise float nearest = shifted - step;
    return nearest;
}

// two of these, rounded, and in a word
uint pack_shares(inout vec2 shares)
{
    shares = vec2(nearest_half_share(shares.x), nearest_half_share(shares.y));
    return packHalf2x16(shares);
}

// two numbers in a word, the first in the low half
uint pack_halves(vec2 v)
{
    return packHalf2x16(vec2(nearest_half(v.x), nearest_half(v.y)));
}
