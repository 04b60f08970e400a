#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = residual + x, eight elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTypeResidual = kF16;
layout(push_constant) uniform AddPush {
    uint rows;
    uint cols;
    uint x_ld; // elements
    uint y_ld;
    uint residual_ld;
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };               // [rows, cols]
layout(binding = 1) readonly buffer Residual { uvec4 residual[]; }; // [rows, cols]
layout(binding = 2) writeonly buffer Y { uvec4 y[]; };              // [rows, cols]

void main()
{
    const uint per_row = (p.cols + 7) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    vec4 lo, hi, r_lo, r_hi;
    LOAD8(x, kTypeX, row * p.x_ld + col, lo, hi);
    LOAD8(residual, kTypeResidual, row * p.residual_ld + col, r_lo, r_hi);
    lo += r_lo;
    hi += r_hi;
    clear_padding(col, p.cols, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
