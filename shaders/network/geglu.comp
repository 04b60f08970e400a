#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = h gelu(gate), blocks of eight columns of h and gate alternating in x; eight elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/activation.glsl"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(push_constant) uniform GegluPush {
    uint rows;
    uint cols; // of y, a multiple of 8
    uint x_ld; // elements
    uint y_ld;
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };  // [rows, 2 * cols]
layout(binding = 1) writeonly buffer Y { uvec4 y[]; }; // [rows, cols]

void main()
{
    const uint per_row = p.cols / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    vec4 lo, hi, gate_lo, gate_hi;
    const uint at = row * p.x_ld + 2 * col;
    LOAD8(x, kTypeX, at, lo, hi);
    LOAD8(x, kTypeX, at + 8, gate_lo, gate_hi);
    lo *= gelu_erf(gate_lo);
    hi *= gelu_erf(gate_hi);
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
