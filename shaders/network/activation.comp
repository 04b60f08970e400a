#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = f(x) of each element, eight of them a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/activation.glsl"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kFunction = 0; // 0: gelu, 1: silu, 2: relu
layout(push_constant) uniform ActivationPush {
    uint rows;
    uint x_ld; // elements, a multiple of 8
    uint y_ld;
    uint y_col; // first column written, a multiple of 8
    uint width; // elements of a row that are worked on, a multiple of 8
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };  // [rows, x_ld]
layout(binding = 1) writeonly buffer Y { uvec4 y[]; }; // [rows, y_ld]

vec4 activate(vec4 v)
{
    if (kFunction == 0)
        return gelu_tanh(v);
    if (kFunction == 1)
        return silu(v);
    return max(v, 0.0);
}

void main()
{
    const uint per_row = p.width / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    vec4 lo, hi;
    LOAD8(x, kTypeX, row * p.x_ld + col, lo, hi);
    lo = activate(lo);
    hi = activate(hi);
    STORE8(y, kTypeY, row * p.y_ld + p.y_col + col, lo, hi);
}
