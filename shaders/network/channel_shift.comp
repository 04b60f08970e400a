#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = x + shift[shift_row[image], col + channel], eight channels a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(push_constant) uniform ChannelShiftPush {
    uint rows;
    uint cols;
    uint first_row;
    uint image_rows;
    uint x_ld;
    uint y_ld;
    uint shift_ld;
    uint shift_col;
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };               // [rows, cols]
layout(binding = 1) readonly buffer Shift { vec4 shift[]; };        // [timesteps, shift_ld]
layout(binding = 2) readonly buffer ShiftRow { uint shift_row[]; }; // [images]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };              // [rows, cols]

void main()
{
    const uint per_row = (p.cols + 7) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    vec4 lo, hi;
    LOAD8(x, kTypeX, row * p.x_ld + col, lo, hi);
    const uint at = (shift_row[(row + p.first_row) / p.image_rows] * p.shift_ld + p.shift_col + col) / 4;
    lo += shift[at];
    hi += shift[at + 1];
    if (col + 8 > p.cols)
        clear_padding(col, p.cols, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
