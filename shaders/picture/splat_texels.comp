#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// numbers of a picture of splats as an image's format has them, one word a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/half.glsl"
#include "lib/rounding.glsl"
#include "lib/thread.glsl"
#include "splat_texels.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTexels = 0; // Texels of kernels/picture.h
layout(constant_id = 1) const bool kLinear = false;
layout(constant_id = 2) const bool kScaled = false;
layout(push_constant) uniform Push { SplatTexelsPush p; };
layout(binding = 0) readonly buffer X { uint x[]; };         // [cameras, pixels, numbers]
layout(binding = 1) readonly buffer Scale { vec2 scale[]; }; // [1] scale, offset, if kScaled
layout(binding = 2) writeonly buffer Y { uint y[]; };        // [cameras, words]

const uint kUnorm8 = 2, kSnorm8 = 3, kHalf4 = 4, kFloat4 = 5, kHalf1 = 6, kFloat1 = 7, kByte = 8;

uint first; // word of the camera's in x

uint bits_of(uint pixel, uint number) { return pixel < p.pixels ? x[first + pixel * p.numbers + number] : 0; }
float number_of(uint pixel, uint number) { return uintBitsToFloat(bits_of(pixel, number)); }

// v most, rounded, halves up; in whole numbers, as a product of floats would be rounded before. Above 0
uint share_of(float v, uint most)
{
    if (!(v > 0.0))
        return 0;
    if (v >= 1.0)
        return most;
    const uint bits = floatBitsToUint(v), shift = 149 - (bits >> 23); // one less than what makes it whole
    return shift > 31 ? 0 : (most * (bits & 0x7fffff | 0x800000) >> shift) + 1 >> 1;
}

// light of an sRGB number. The power is a driver's guess, which Newton's step for its fifth power corrects
float light_of(float v)
{
    if (v <= 0.04045)
        return divide(v, 12.92);
    const float base = divide(v + 0.055, 1.055), square = base * base;
    const float guess = pow(base, 0.4), fourth = guess * guess * guess * guess;
    return square * (guess - (guess * fourth - square) / (5.0 * fourth)); // base^2 base^(2/5)
}

float color_of(uint pixel, uint channel)
{
    const float v = number_of(pixel, channel);
    if (!kLinear || channel == 3)
        return v;
    const float alpha = number_of(pixel, 3);
    return alpha > 0.0 ? alpha * light_of(divide(v, alpha)) : 0.0;
}

// the mean depth, in metres or as a z-buffer has it
float depth_of(uint pixel)
{
    const float metres = number_of(pixel, 0);
    if (!kScaled)
        return metres;
    precise float z = scale[0].y + (metres > 0.0 ? divide(scale[0].x, metres) : 0.0);
    return clamp(z, 0.0, 1.0);
}

uint word_of(uint i)
{
    uint word = 0;
    if (kTexels == kUnorm8) {
        for (uint c = 0; c < 4; ++c)
            word |= share_of(color_of(i, c), 255) << 8 * c;
    } else if (kTexels == kSnorm8) {
        for (uint c = 0; c < 3; ++c) {
            const float v = number_of(i, c);
            const uint share = share_of(abs(v), 127);
            word |= (v < 0.0 ? -share & 255 : share) << 8 * c;
        }
    } else if (kTexels == kHalf4) {
        word = pack_halves(vec2(color_of(i / 2, i % 2 * 2), color_of(i / 2, i % 2 * 2 + 1)));
    } else if (kTexels == kFloat4) {
        word = floatBitsToUint(color_of(i / 4, i % 4));
    } else if (kTexels == kHalf1) {
        word = pack_halves(vec2(depth_of(2 * i), depth_of(2 * i + 1)));
    } else if (kTexels == kFloat1) {
        word = floatBitsToUint(depth_of(i));
    } else if (kTexels == kByte) {
        for (uint c = 0; c < 4; ++c)
            word |= min(bits_of(4 * i + c, 0), 255u) << 8 * c;
    } else {
        word = bits_of(i, 0);
    }
    return word;
}

void main()
{
    const uint i = linear_thread(), camera = i / p.words;
    if (camera >= p.cameras)
        return;
    first = camera * p.pixels * p.numbers;
    y[i] = word_of(i % p.words);
}
