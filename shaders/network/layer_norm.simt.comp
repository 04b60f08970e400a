#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * weight + bias, one workgroup a row
#extension GL_GOOGLE_include_directive : require
#include "layer_norm.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kHalfX = false;
layout(constant_id = 1) const bool kHalfY = false;
layout(constant_id = 2) const uint kTileM = 1;
layout(push_constant) uniform Push { LayerNormPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };          // [rows, cols]
layout(binding = 1) readonly buffer Weight { vec4 weight[]; }; // [cols] fp32
layout(binding = 2) readonly buffer Bias { vec4 bias[]; };     // [cols] fp32
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };         // [rows, cols]
#include "lib/row_norm.simt.glsl"

void main()
{
    const uint row = linear_group();
    if (row >= p.rows)
        return;
    float mean, inverse;
    row_statistics(row * p.x_ld, mean, inverse);
    for (uint c = gl_LocalInvocationID.x * 8; c < p.cols; c += 64 * 8) {
        vec4 lo, hi;
        LOAD8(x, kHalfX, row * p.x_ld + c, lo, hi);
        lo = (lo - mean) * inverse * weight[c / 4] + bias[c / 4];
        hi = (hi - mean) * inverse * weight[c / 4 + 1] + bias[c / 4 + 1];
        clear_padding(c, p.cols, lo, hi);
        STORE8(y, kHalfY, row * p.y_ld + c, lo, hi);
    }
}
