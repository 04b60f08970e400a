// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// eight elements of a row of W from k on, a multiple of 8, as the fp16 that matrix units take: the number that a block
// stands for is exact in fp32, and rounded once
#include "lib/weight.glsl"

uvec4 load_weight_halves(uint row_at, uint k)
{
    if (kTypeW == kF16)
        return WEIGHT(row_at + k / 8);
    vec4 lo, hi;
    load_weight8(row_at, k, lo, hi);
    return pack8(lo, hi);
}
