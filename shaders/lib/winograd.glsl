// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Winograd's F(4, 3), a correlation of six samples with three taps from six products: y = A^T ((G g) * (B^T d)), twice
// for two dimensions. Points 0, +-sqrt(1/2), +-sqrt(2) and infinity (Toom-Cook): over 320 channels in fp32 the error
// is 1.8e-7 of the result's size, half of that of the usual 0, +-1, +-2; operands stored in fp16 would make it 1.2e-3.
#include "lib/pack.glsl"
const uint kOutputs = 4;             // of a tile, per dimension
const uint kSamples = 6;             // that they see
const float kA = 0.7071067811865476; // sqrt(1/2)
const float kB = 1.4142135623730951; // sqrt(2)

// B^T d, of values of type CHANNELS
#define WINOGRAD_INPUT(d0, d1, d2, d3, d4, d5)                                                                         \
    {                                                                                                                  \
        const CHANNELS even_a = d4 - 2.0 * d2, odd_a = kA * d3 - kB * d1;                                              \
        const CHANNELS even_b = d4 - 0.5 * d2, odd_b = kB * d3 - kA * d1;                                              \
        d0 = d0 - 2.5 * d2 + d4;                                                                                       \
        d5 = d1 - 2.5 * d3 + d5;                                                                                       \
        d1 = even_a + odd_a;                                                                                           \
        d2 = even_a - odd_a;                                                                                           \
        d3 = even_b + odd_b;                                                                                           \
        d4 = even_b - odd_b;                                                                                           \
    }

// G g
#define WINOGRAD_WEIGHT(g0, g1, g2, u)                                                                                 \
    {                                                                                                                  \
        const vec4 even_a = (g0 * 2.0 + g2) * (-1.0 / 3.0), odd_a = g1 * (-2.0 / 3.0 * kA);                            \
        const vec4 even_b = g0 * (1.0 / 6.0) + g2 * (1.0 / 3.0), odd_b = g1 * (1.0 / 6.0 * kB);                        \
        u[0] = g0;                                                                                                     \
        u[1] = even_a + odd_a;                                                                                         \
        u[2] = even_a - odd_a;                                                                                         \
        u[3] = even_b + odd_b;                                                                                         \
        u[4] = even_b - odd_b;                                                                                         \
        u[5] = g2;                                                                                                     \
    }

// A^T m, left in m0..m3
#define WINOGRAD_OUTPUT(m0, m1, m2, m3, m4, m5)                                                                        \
    {                                                                                                                  \
        const vec4 sum_a = m1 + m2, difference_a = m1 - m2, sum_b = m3 + m4, difference_b = m3 - m4;                   \
        m0 = m0 + sum_a + sum_b;                                                                                       \
        m1 = kA * difference_a + kB * difference_b;                                                                    \
        m2 = 0.5 * sum_a + 2.0 * sum_b;                                                                                \
        m3 = (0.5 * kA) * difference_a + (2.0 * kB) * difference_b + m5;                                               \
    }

// four elements of row-major words behind a texel buffer, at an element index that is a multiple of 4
#define FETCH4(words, type, at)                                                                                        \
    (type == kF16 ? half4(texelFetch(words, int((at) / 8)), (at) % 8 != 0)                                                  \
                  : uintBitsToFloat(texelFetch(words, int((at) / 4))))
vec4 half4(uvec4 w, bool upper)
{
    const uvec2 v = upper ? w.zw : w.xy;
    return vec4(unpackHalf2x16(v.x), unpackHalf2x16(v.y));
}
