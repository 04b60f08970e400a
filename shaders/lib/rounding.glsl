// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Numbers rounded as a CPU rounds them. Vulkan rounds sums, differences and products to the nearest float, but lets a
// quotient or a root be some units in the last place off: these are corrected by what is left of them, which is known
// exactly. Everything is `precise`: a contracted product would not leave what is expected.

// p + e = a b, without an error (Dekker): for factors that are not close to overflow
vec2 two_product(float a, float b)
{
    precise float p = a * b;
    precise float ca = 4097.0 * a, cb = 4097.0 * b;
    precise float ah = ca - (ca - a), bh = cb - (cb - b);
    precise float al = a - ah, bl = b - bh;
    precise float e = ((ah * bh - p) + ah * bl + al * bh) + al * bl;
    return vec2(p, e);
}

float divide(float x, float y)
{
    precise float q = x / y;
    const vec2 back = two_product(q, y);
    precise float rest = (x - back.x) - back.y;
    precise float corrected = q + rest / y;
    return corrected;
}

float square_root(float x)
{
    if (!(x > 0.0))
        return 0.0;
    precise float s = sqrt(x);
    const vec2 back = two_product(s, s);
    precise float rest = (x - back.x) - back.y;
    precise float corrected = s + rest / (2.0 * s);
    return corrected;
}

// of what is not negative: halves go up
uint rounded(float x)
{
    const float whole = floor(x);
    precise float rest = x - whole;
    return uint(whole) + (rest >= 0.5 ? 1u : 0u);
}
