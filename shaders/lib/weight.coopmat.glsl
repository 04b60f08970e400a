// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// eight elements of a row of W from k on, a multiple of 8, as the fp16 that matrix units take. An int8 is exact in fp16,
// so the number that a block stands for is rounded once.
#include "lib/weight.glsl"

uvec4 load_weight_halves(uint row_at, uint k)
{
    if (kTypeW == kF16)
        return WEIGHT(row_at + k / 8);
    vec4 lo, hi;
    if (kTypeW != kQ8_0) {
        load_weight8(row_at, k, lo, hi);
        return pack8(lo, hi);
    }
    const uvec2 words = block_words(row_at, k);
    const float16_t scale = float16_t(block_scale(row_at, k));
    const f16vec4 first = scale * f16vec4(signed_bytes(words.x)), second = scale * f16vec4(signed_bytes(words.y));
    return uvec4(packFloat2x16(first.xy), packFloat2x16(first.zw), packFloat2x16(second.xy), packFloat2x16(second.zw));
}
