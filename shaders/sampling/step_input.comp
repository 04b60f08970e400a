#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[r] = in_scale x[r mod x_rows]: what the network sees of the state, once per guidance half; eight elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeY = kF16;
layout(push_constant) uniform StepInputPush {
    uint rows; // of y
    uint cols;
    uint x_rows;
    uint x_ld; // elements
    uint y_ld;
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) readonly buffer X { vec4 x[]; };   // [x_rows, cols]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; }; // [rows, cols]

void main()
{
    const uint per_row = (p.cols + 7) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    const uint from = row % p.x_rows * p.x_ld + col;
    const float scale = steps[clock.row].in_scale;
    vec4 lo = scale * x[from / 4], hi = scale * x[from / 4 + 1];
    clear_padding(col, p.cols, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
