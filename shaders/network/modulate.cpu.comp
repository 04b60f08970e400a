#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * (1 + scale) + shift, for devices that are CPUs: one row a lane, loads through
// texel buffers, no shared memory; the mean is taken out before squaring
#extension GL_GOOGLE_include_directive : require
#include "modulate.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 8;
layout(push_constant) uniform Push { ModulatePush p; };
layout(binding = 0) uniform usamplerBuffer X;                       // [groups * rows, cols]
layout(binding = 1) uniform usamplerBuffer Table;                   // [timesteps, table_ld]
layout(binding = 2) readonly buffer TableRow { uint table_row[]; }; // [groups * rows]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols]

#include "lib/row_norm.cpu.glsl"

// columns of the table start anywhere when N is not a multiple of 4
vec4 load_table(uint at)
{
    const vec4 a = uintBitsToFloat(texelFetch(Table, int(at / 4)));
    if (at % 4 == 0)
        return a;
    const vec4 b = uintBitsToFloat(texelFetch(Table, int(at / 4 + 1)));
    return at % 4 == 1 ? vec4(a.yzw, b.x) : at % 4 == 2 ? vec4(a.zw, b.xy) : vec4(a.w, b.xyz);
}

void main()
{
    const uint row = linear_thread();
    const uint in_row = row * p.x_ld;
    if (row >= p.rows * p.groups)
        return;
    float mean, inverse;
    row_statistics(in_row, mean, inverse);
    vec4 lo, hi;
    const uint modulation = table_row[row] * p.table_ld + row / p.rows * p.step;
    for (uint c = 0; c < p.cols; c += 8) {
        load_x(in_row + c, lo, hi);
        const uint scale = modulation + p.scale_col + c, shift = modulation + p.shift_col + c;
        lo = (lo - mean) * inverse * (1.0 + load_table(scale)) + load_table(shift);
        hi = (hi - mean) * inverse * (1.0 + load_table(scale + 4)) + load_table(shift + 4);
        clear_padding(c, p.cols, lo, hi);
        STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
    }
}
