#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a sample's colour: its four texels, bilinearly in linear light, times its factor, as sRGB bytes
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform SurfaceColorPush {
    uint size; // samples
} p;
layout(binding = 0) readonly buffer Samples { float samples[]; };  // [size, 8]
layout(binding = 1) readonly buffer Texels { uvec4 texels[]; };    // [size]
layout(binding = 2) readonly buffer Linear { float linear_of[]; }; // [512] of sRGB bytes; then of bytes and a half
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };             // [size] bits of the offset from the centre, in voxels; rgb

vec3 linear_texel(uint c)
{
    return vec3(linear_of[c & 255u], linear_of[c >> 8 & 255u], linear_of[c >> 16 & 255u]);
}

// the byte whose linear value is nearest in sRGB: exact on every device, unlike pow
uint srgb_byte(float value)
{
    uint low = 0, high = 255;
    while (low < high) {
        const uint middle = (low + high) / 2;
        if (value < linear_of[256 + middle])
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

void main()
{
    const uint i = linear_thread();
    if (i >= p.size)
        return;
    const uint at = 8 * i;
    const uvec4 t = texels[i];
    const vec3 upper = mix(linear_texel(t.x), linear_texel(t.y), samples[at + 3]);
    const vec3 lower = mix(linear_texel(t.z), linear_texel(t.w), samples[at + 3]);
    const vec3 factor = vec3(samples[at + 5], samples[at + 6], samples[at + 7]);
    const vec3 color = mix(upper, lower, samples[at + 4]) * factor;
    const uint bits = srgb_byte(color.x) | srgb_byte(color.y) << 8 | srgb_byte(color.z) << 16;
    y[i] = uvec4(floatBitsToUint(vec3(samples[at], samples[at + 1], samples[at + 2])), bits);
}
