#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = what fp16 stores make of x where the device packs to the nearest number, and where it packs toward zero
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

uint toward_zero(float x)
{
    const uint sign = floatBitsToUint(x) >> 16 & 0x8000u, magnitude = floatBitsToUint(x) & 0x7fffffffu;
    if (magnitude >= 0x7f800000u)
        return sign | (magnitude > 0x7f800000u ? 0x7e00u : 0x7c00u);
    if (magnitude >= 0x47800000u)
        return sign | 0x7bffu; // as AMD's v_cvt_pkrtz_f16_f32
    if (magnitude >= 0x38800000u)
        return sign | (magnitude - 0x38000000u) >> 13;
    return sign | uint(abs(x) * 16777216.0); // subnormal: multiples of 2^-24
}

uint pack_toward_zero(vec2 v)
{
    return toward_zero(v.x) | toward_zero(v.y) << 16;
}

layout(local_size_x = 64) in;
layout(push_constant) uniform HalfRoundingPush {
    uint count; // pairs
} p;

// lib/half.glsl twice: with the device's packHalf2x16 and with one that AMD's compilers might have
#define nearest_half nearest_half_here
#define pack_halves pack_here
#define nearest_half_share nearest_half_share_here
#define pack_shares pack_shares_here
#include "lib/half.glsl"
#undef nearest_half
#undef pack_halves
#undef nearest_half_share
#undef pack_shares
#define packHalf2x16 pack_toward_zero
#include "lib/half.glsl"
#undef packHalf2x16

layout(binding = 0) readonly buffer X { vec2 x[]; };   // [count]
layout(binding = 1) writeonly buffer Y { uvec4 y[]; }; // [count]: ours, ours on a device that truncates, truncated, shares

void main()
{
    const uint i = linear_thread();
    if (i >= p.count)
        return;
    vec2 shares = min(abs(x[i]), 1.0);
    y[i] = uvec4(pack_here(x[i]), pack_halves(x[i]), pack_toward_zero(x[i]), pack_shares(shares));
}
