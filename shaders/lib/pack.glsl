// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

#ifndef SEMROVER_PACK_GLSL
#define SEMROVER_PACK_GLSL
#include "lib/half.glsl"

// types of elements, which the runtime gives to constants kType<B>; the default of one is the last that its shader takes
const uint kF32 = 0, kF16 = 1, kQ8_0 = 2; // q8_0: lib/weight.glsl

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

// eight elements of row-major words, at an element index that is a multiple of 8, in a buffer or behind a texel buffer
#define LOAD8(words, type, at, lo, hi)                                                                                 \
    UNPACK8(type, words[(at) / 8], words[(at) / 4], words[(at) / 4 + 1], lo, hi)
#define FETCH8(image, type, at, lo, hi)                                                                                \
    UNPACK8(type, texelFetch(image, int((at) / 8)), texelFetch(image, int((at) / 4)),                                  \
            texelFetch(image, int((at) / 4 + 1)), lo, hi)
#define UNPACK8(type, halves, floats, next_floats, lo, hi)                                                             \
    if (type == kF16) {                                                                                                \
        unpack8(halves, lo, hi);                                                                                       \
    } else {                                                                                                           \
        lo = uintBitsToFloat(floats);                                                                                  \
        hi = uintBitsToFloat(next_floats);                                                                             \
    }
#define STORE8(words, type, at, lo, hi)                                                                                \
    if (type == kF16) {                                                                                                \
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

#endif
