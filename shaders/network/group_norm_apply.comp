#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = silu((x - mean) * scale + bias), over one input or two side by side; eight channels a thread
// note: the mean is taken off first. A group of one pixel has a scale of weight / sqrt(eps), up to 1000, which would
// make a shift of bias - mean * scale lose three digits
#extension GL_GOOGLE_include_directive : require
#include "group_norm.h"
#include "lib/activation.glsl"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kHalfX = false; // x2 has the type of x
layout(constant_id = 1) const bool kHalfY = false;
layout(constant_id = 2) const bool kSilu = false;
layout(push_constant) uniform Push { GroupNormApplyPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };        // [rows, x_cols]
layout(binding = 1) readonly buffer X2 { uvec4 x2[]; };      // [rows, x2_cols]
layout(binding = 2) readonly buffer Scale { vec4 scale[]; }; // [2 * sets, x_cols + x2_cols]: scales, then means
layout(binding = 3) readonly buffer Bias { vec4 bias[]; };   // [x_cols + x2_cols]
layout(binding = 4) writeonly buffer Y { uvec4 y[]; };       // [rows, x_cols + x2_cols]

void main()
{
    const uint cols = p.x_cols + p.x2_cols, per_row = (cols + 7) / 8;
    const uint row = linear_thread() / per_row, col = linear_thread() % per_row * 8;
    if (row >= p.rows)
        return;
    vec4 lo, hi;
    if (col < p.x_cols) {
        LOAD8(x, kHalfX, row * p.x_ld + col, lo, hi);
    } else {
        LOAD8(x2, kHalfX, row * p.x2_ld + col - p.x_cols, lo, hi);
    }
    const uint set = (row + p.first_row) / p.image_rows;
    const uint at = (2 * set * p.scale_ld + col) / 4, mean_at = at + p.scale_ld / 4;
    lo = (lo - scale[mean_at]) * scale[at] + bias[col / 4];
    hi = (hi - scale[mean_at + 1]) * scale[at + 1] + bias[col / 4 + 1];
    if (kSilu) {
        lo = silu(lo);
        hi = silu(hi);
    }
    if (col + 8 > cols)
        clear_padding(col, cols, lo, hi);
    STORE8(y, kHalfY, row * p.y_ld + col, lo, hi);
}
