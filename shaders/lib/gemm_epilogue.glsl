// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// the epilogue of every GEMM variant, eight columns at a time:
//   v = sum + bias;  v = gelu(v) or silu(v);  v = residual + gate[gate_row[row]] * v, or residual + v
// note: the ids of the constants are in the order of application, which the fuse stage relies on
#include "lib/activation.glsl"
#include "lib/pack.glsl"

layout(constant_id = 10) const bool kBias = false;
layout(constant_id = 11) const bool kGelu = false;
layout(constant_id = 12) const bool kSilu = false;
layout(constant_id = 13) const bool kGatedAdd = false;
layout(constant_id = 14) const bool kAdd = false;
layout(constant_id = 15) const bool kHalfY = false;
layout(constant_id = 16) const bool kHalfResidual = false;

layout(binding = 2) readonly buffer Bias { vec4 bias[]; };          // [groups, cols]
layout(binding = 3) readonly buffer Gate { float gate[]; };         // [timesteps, gate_ld]
layout(binding = 4) readonly buffer GateRow { uint gate_row[]; };   // [groups * rows]
layout(binding = 5) readonly buffer Residual { uvec4 residual[]; }; // [groups * rows, cols]
layout(binding = 6) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols]

void add_residual(uint group, uint row, uint col, inout vec4 lo, inout vec4 hi)
{
    vec4 r_lo, r_hi;
    LOAD8(residual, kHalfResidual, row * p.residual_ld + col, r_lo, r_hi);
    if (kAdd) {
        lo += r_lo;
        hi += r_hi;
        return;
    }
    const uint g = gate_row[row] * p.gate_ld + p.gate_col + group * p.gate_step + col;
    lo = r_lo + vec4(gate[g], gate[g + 1], gate[g + 2], gate[g + 3]) * lo;
    hi = r_hi + vec4(gate[g + 4], gate[g + 5], gate[g + 6], gate[g + 7]) * hi;
}

// row within the group, col a multiple of 8; columns in the padding are written as zero
void store8(uint group, uint row, uint col, vec4 lo, vec4 hi)
{
    if (row >= p.rows || col >= p.cols)
        return;
    if (kBias) {
        lo += bias[(group * p.bias_ld + col) / 4];
        hi += bias[(group * p.bias_ld + col) / 4 + 1];
    }
    if (kGelu) {
        lo = gelu_tanh(lo);
        hi = gelu_tanh(hi);
    }
    if (kSilu) {
        lo = silu(lo);
        hi = silu(hi);
    }
    row += group * p.rows;
    if (kGatedAdd || kAdd)
        add_residual(group, row, col, lo, hi);
    if (col + 8 > p.cols)
        clear_padding(col, p.cols, lo, hi);
    STORE8(y, kHalfY, row * p.y_ld + col, lo, hi);
}
