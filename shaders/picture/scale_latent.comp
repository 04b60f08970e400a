#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - shift) factor of the first columns of x, or the way back; zeros in padding; an element a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/rounding.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kBack = false; // y = x / factor + shift
layout(push_constant) uniform ScaleLatentPush {
    uint rows;   // of y
    uint pixels; // rows that are not padding
    uint cols;   // of y
    uint x_ld;   // elements, of x
    uint y_ld;
    float factor, shift;
} p;
layout(binding = 0) readonly buffer X { float x[]; };  // [rows, cols or more]
layout(binding = 1) writeonly buffer Y { float y[]; }; // [rows, cols]

void main()
{
    const uint i = linear_thread(), row = i / p.y_ld, col = i % p.y_ld;
    if (row >= p.rows)
        return;
    precise float v = 0.0;
    if (row < p.pixels && col < p.cols) {
        const float from = x[row * p.x_ld + col];
        v = kBack ? divide(from, p.factor) + p.shift : (from - p.shift) * p.factor;
    }
    y[i] = v;
}
