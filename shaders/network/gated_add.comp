#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = residual + gate[gate_row[row], gate_col + group * gate_step + col] * x, one row-column pair of 8 a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTypeResidual = kF16;
layout(push_constant) uniform GatedAddPush {
    uint rows; // of one group
    uint cols;
    uint groups;
    uint x_ld; // elements
    uint y_ld;
    uint residual_ld;
    uint gate_ld;
    uint gate_col;
    uint gate_step;
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };               // [groups * rows, cols]
layout(binding = 1) readonly buffer Gate { float gate[]; };         // [timesteps, gate_ld]
layout(binding = 2) readonly buffer GateRow { uint gate_row[]; };   // [groups * rows]
layout(binding = 3) readonly buffer Residual { uvec4 residual[]; }; // [groups * rows, cols]
layout(binding = 4) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols]

void main()
{
    const uint per_row = (p.cols + 7) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows * p.groups)
        return;
    vec4 lo, hi, r_lo, r_hi;
    LOAD8(x, kTypeX, row * p.x_ld + col, lo, hi);
    LOAD8(residual, kTypeResidual, row * p.residual_ld + col, r_lo, r_hi);
    const uint g = gate_row[row] * p.gate_ld + p.gate_col + row / p.rows * p.gate_step + col;
    lo = r_lo + vec4(gate[g], gate[g + 1], gate[g + 2], gate[g + 3]) * lo;
    hi = r_hi + vec4(gate[g + 4], gate[g + 5], gate[g + 6], gate[g + 7]) * hi;
    clear_padding(col, p.cols, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + col, lo, hi);
}
