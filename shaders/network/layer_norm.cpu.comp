#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * weight + bias, for devices that are CPUs: one row a lane, loads through texel
// buffers, no shared memory
#extension GL_GOOGLE_include_directive : require
#include "layer_norm.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 8;
layout(push_constant) uniform Push { LayerNormPush p; };
layout(binding = 0) uniform usamplerBuffer X;          // [rows, cols]
layout(binding = 1) uniform usamplerBuffer Weight;     // [cols] fp32
layout(binding = 2) uniform usamplerBuffer Bias;       // [cols] fp32
layout(binding = 3) writeonly buffer Y { uvec4 y[]; }; // [rows, cols]
#include "lib/row_norm.cpu.glsl"

void main()
{
    const uint row = linear_thread();
    if (row >= p.rows)
        return;
    float mean, inverse;
    row_statistics(row * p.x_ld, mean, inverse);
    for (uint c = 0; c < p.cols; c += 8) {
        vec4 lo, hi;
        load_x(row * p.x_ld + c, lo, hi);
        const int at = int(c / 4);
        lo = (lo - mean) * inverse * uintBitsToFloat(texelFetch(Weight, at)) + uintBitsToFloat(texelFetch(Bias, at));
        hi = (hi - mean) * inverse * uintBitsToFloat(texelFetch(Weight, at + 1)) + uintBitsToFloat(texelFetch(Bias, at + 1));
        clear_padding(c, p.cols, lo, hi);
        STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
    }
}
