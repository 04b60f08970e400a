// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

#include "lib/half.glsl"

// storage is 32-bit words: fp32, or two fp16 each, so that fp16 needs no device feature
void unpack8(uvec4 w, out vec4 lo, out vec4 hi)
{
    lo = vec4(unpackHalf2x16(w.x), unpackHalf2x16(w.y));
    hi = vec4(unpackHalf2x16(w.z), unpackHalf2x16(w.w));
}

uvec4 pack8(vec4 lo, vec4 hi)
{
    return uvec4(pack_halves(lo.xy), pack_halves(lo.zw), pack_halves(hi.xy), pack_halves(hi.zw));
}

// eight elements of row-major words, at an element index that is a multiple of 8
#define LOAD8(words, is_half, at, lo, hi)                                                                              \
    if (is_half) {                                                                                                     \
        unpack8(words[(at) / 8], lo, hi);                                                                              \
    } else {                                                                                                           \
        lo = uintBitsToFloat(words[(at) / 4]);                                                                         \
        hi = uintBitsToFloat(words[(at) / 4 + 1]);                                                                     \
    }
#define STORE8(words, is_half, at, lo, hi)                                                                             \
    if (is_half) {                                                                                                     \
        words[(at) / 8] = pack8(lo, hi);                                                                               \
    } else {                                                                                                           \
        words[(at) / 4] = floatBitsToUint(lo);                                                                         \
        words[(at) / 4 + 1] = floatBitsToUint(hi);                                                                     \
    }

// zeroes the columns from `cols` on of eight that start at `col`: the padding of a row
void clear_padding(uint col, uint cols, inout vec4 lo, inout vec4 hi)
{
    const uvec4 i = uvec4(0, 1, 2, 3) + col;
    lo = mix(vec4(0.0), lo, lessThan(i, uvec4(cols)));
    hi = mix(vec4(0.0), hi, lessThan(i + 4, uvec4(cols)));
}
