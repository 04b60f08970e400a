#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * weight + bias, 16 threads a row
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "layer_norm.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 4;
layout(constant_id = 3) const uint kKept = 1;
layout(push_constant) uniform Push { LayerNormPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };          // [rows, cols]
layout(binding = 1) readonly buffer Weight { vec4 weight[]; }; // [cols] fp32
layout(binding = 2) readonly buffer Bias { vec4 bias[]; };     // [cols] fp32
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };         // [rows, cols]
#include "lib/row_norm.simt.glsl"

void write(uint row, uint sweep, vec4 lo, vec4 hi, float mean, float inverse)
{
    const uint c = sweep_col(sweep);
    lo = (lo - mean) * inverse * weight[c / 4] + bias[c / 4];
    hi = (hi - mean) * inverse * weight[c / 4 + 1] + bias[c / 4 + 1];
    clear_beyond(sweep, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
}

void main()
{
    const uint row = linear_group() * kTileM + row_in_group(), from = min(row, p.rows - 1) * p.x_ld;
    float mean, inverse;
    row_statistics(from, mean, inverse);
    if (row >= p.rows)
        return;
    vec4 lo, hi;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        if (in_row(i))
            write(row, i, lo, hi, mean, inverse);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, from + sweep_col(i), lo, hi);
        write(row, i, lo, hi, mean, inverse);
    }
}
