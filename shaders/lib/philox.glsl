// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Philox4x32-10, Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011
#include "lib/logarithm.glsl"
#include "lib/trigonometry.glsl"

uvec4 philox(uvec4 counter, uvec2 key)
{
    for (int round = 0; round < 10; ++round) {
        uint high0, low0, high1, low1;
        umulExtended(0xD2511F53u, counter.x, high0, low0);
        umulExtended(0xCD9E8D57u, counter.z, high1, low1);
        counter = uvec4(high1 ^ counter.y ^ key.x, low1, high0 ^ counter.w ^ key.y, low0);
        key += uvec2(0x9E3779B9u, 0xBB67AE85u);
    }
    return counter;
}

// two pairs of standard normals from four words; u in (0, 1], v in [0, 1)
vec4 box_muller(uvec4 bits)
{
    const vec2 u = (vec2(bits.xz >> 8) + 1.0) * (1.0 / 16777216.0);
    const vec2 v = vec2(bits.yw >> 8) * (6.283185307179586 / 16777216.0);
    const vec2 radius = sqrt(-2.0 * vec2(accurate_log(u.x), accurate_log(u.y)));
    return vec4(radius.x * accurate_cos(v.x), radius.x * accurate_sin(v.x), radius.y * accurate_cos(v.y),
                radius.y * accurate_sin(v.y));
}
