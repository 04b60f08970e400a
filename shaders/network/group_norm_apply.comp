#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = silu((x - mean) * scale + bias), over one input or two side by side; eight channels of four rows
// a thread
// note: the mean is taken off first. A group of one pixel has a scale of weight / sqrt(eps), up to 1000, which would
// make a shift of bias - mean * scale lose three digits
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "group_norm.h"
#include "lib/activation.glsl"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 4) const uint kTypeX2 = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const bool kSilu = false;
layout(constant_id = 3) const uint kTileM = 4; // rows of a thread; images and bands start at multiples of it
layout(push_constant) uniform Push { GroupNormApplyPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };        // [rows, x_cols]
layout(binding = 1) readonly buffer X2 { uvec4 x2[]; };      // [rows, x2_cols]
layout(binding = 2) readonly buffer Scale { vec4 scale[]; }; // [2 * sets, x_cols + x2_cols]: scales, then means
layout(binding = 3) readonly buffer Bias { vec4 bias[]; };   // [x_cols + x2_cols]
layout(binding = 4) writeonly buffer Y { uvec4 y[]; };       // [rows, x_cols + x2_cols]

void main()
{
    const uint cols = p.x_cols + p.x2_cols, per_row = (cols + 7) / 8;
    const uint first = linear_thread() / per_row * kTileM, col = linear_thread() % per_row * 8;
    if (first >= p.rows)
        return;
    vec4 lo[kTileM], hi[kTileM];
    [[unroll]] for (uint i = 0; i < kTileM; ++i) {
        const uint row = min(first + i, p.rows - 1);
        if (col < p.x_cols) {
            LOAD8(x, kTypeX, row * p.x_ld + col, lo[i], hi[i]);
        } else {
            LOAD8(x2, kTypeX2, row * p.x2_ld + col - p.x_cols, lo[i], hi[i]);
        }
    }
    const uint set = (first + p.first_row) / p.image_rows;
    const uint at = (2 * set * p.scale_ld + col) / 4, mean_at = at + p.scale_ld / 4;
    const vec4 scales[2] = vec4[2](scale[at], scale[at + 1]), means[2] = vec4[2](scale[mean_at], scale[mean_at + 1]);
    const vec4 biases[2] = vec4[2](bias[col / 4], bias[col / 4 + 1]);
    [[unroll]] for (uint i = 0; i < kTileM; ++i) {
        vec4 y_lo = (lo[i] - means[0]) * scales[0] + biases[0], y_hi = (hi[i] - means[1]) * scales[1] + biases[1];
        if (kSilu) {
            y_lo = silu(y_lo);
            y_hi = silu(y_hi);
        }
        if (col + 8 > cols)
            clear_padding(col, cols, y_lo, y_hi);
        if (first + i < p.rows) {
            STORE8(y, kTypeY, (first + i) * p.y_ld + col, y_lo, y_hi);
        }
    }
}
