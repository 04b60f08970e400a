#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = per axis [sin(x w_0), sin(x w_1), .., cos(x w_0), cos(x w_1), ..], or cosines first; one element a thread pair
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"
#include "lib/trigonometry.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeY = kF16;
layout(push_constant) uniform SinusoidPush {
    uint rows;
    uint axes;        // values of a row of x
    uint frequencies; // per axis
    uint y_ld;        // elements
    uint cosines_lead;   // 1: [cos, sin] per axis, 0: [sin, cos]
} p;
layout(binding = 0) readonly buffer X { float x[]; };                   // [rows, axes]
layout(binding = 1) readonly buffer Frequencies { float frequency[]; }; // [frequencies]
layout(binding = 2) writeonly buffer Y { uint y[]; };                   // [rows, axes * 2 * frequencies]

float element(uint row, uint col)
{
    const uint axis = col / (2 * p.frequencies), within = col % (2 * p.frequencies);
    if (axis >= p.axes)
        return 0.0; // padding
    const float angle = x[row * p.axes + axis] * frequency[within % p.frequencies];
    const bool second = within >= p.frequencies;
    return second != (p.cosines_lead != 0) ? accurate_cos(angle) : accurate_sin(angle);
}

void main()
{
    const uint per_row = p.y_ld / 2;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 2;
    if (row >= p.rows)
        return;
    const vec2 pair = vec2(element(row, col), element(row, col + 1));
    const uint at = row * p.y_ld + col;
    if (kTypeY == kF16) {
        y[at / 2] = pack_halves(pair);
    } else {
        y[at] = floatBitsToUint(pair.x);
        y[at + 1] = floatBitsToUint(pair.y);
    }
}
