#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * weight + bias, for devices that are CPUs: one row a lane, loads through texel
// buffers, no shared memory
#extension GL_GOOGLE_include_directive : require
#include "layer_norm.h"
#include "lib/thread.glsl"

layout(local_size_x = 8) in;
layout(constant_id = 0) const bool kHalfX = false;
layout(constant_id = 1) const bool kHalfY = false;
layout(constant_id = 2) const uint kTileM = 8;
layout(push_constant) uniform Push { LayerNormPush p; };
layout(binding = 0) uniform usamplerBuffer X;          // [rows, cols]
layout(binding = 1) uniform usamplerBuffer Weight;     // [1, cols]
layout(binding = 2) uniform usamplerBuffer Bias;       // [1, cols]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; }; // [rows, cols]
#include "lib/row_moments_lane.glsl"

vec4 weight4(uint at) { return uintBitsToFloat(texelFetch(Weight, int(at / 4))); }
vec4 bias4(uint at) { return uintBitsToFloat(texelFetch(Bias, int(at / 4))); }

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    const RowMoments m = row_moments(row);
    for (uint c = 0; c < p.cols; c += 8) {
        vec4 lo, hi;
        load_x(row * p.x_ld + c, lo, hi);
        lo = (lo - m.mean) * m.inverse * weight4(c) + bias4(c);
        hi = (hi - m.mean) * m.inverse * weight4(c + 4) + bias4(c + 4);
        clear_padding(c, p.cols, lo, hi);
        STORE8(y, kHalfY, row * p.y_ld + c, lo, hi);
    }
}
