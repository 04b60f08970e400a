#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * (1 + scale) + shift, 16 threads a row; the mean is taken out before squaring
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "modulate.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 4;
layout(constant_id = 3) const uint kKept = 1;
layout(constant_id = 4) const bool kAligned = false; // columns and rows of the table start at multiples of 4
layout(push_constant) uniform Push { ModulatePush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };               // [groups * rows, cols]
layout(binding = 1) readonly buffer Table { vec4 table[]; };        // [timesteps, table_ld]
layout(binding = 2) readonly buffer TableRow { uint table_row[]; }; // [groups * rows]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols]
#include "lib/row_norm.simt.glsl"

vec4 load_table(uint at)
{
    const vec4 a = table[at / 4];
    if (kAligned || at % 4 == 0)
        return a;
    const vec4 b = table[at / 4 + 1];
    return at % 4 == 1 ? vec4(a.yzw, b.x) : at % 4 == 2 ? vec4(a.zw, b.xy) : vec4(a.w, b.xyz);
}

void write(uint row, uint sweep, vec4 lo, vec4 hi, float mean, float inverse, uint modulation)
{
    const uint c = sweep_col(sweep), scale = modulation + p.scale_col + c, shift = modulation + p.shift_col + c;
    lo = (lo - mean) * inverse * (1.0 + load_table(scale)) + load_table(shift);
    hi = (hi - mean) * inverse * (1.0 + load_table(scale + 4)) + load_table(shift + 4);
    clear_beyond(sweep, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
}

void main()
{
    const uint rows = p.rows * p.groups, row = linear_group() * kTileM + row_in_group(), from = min(row, rows - 1);
    const uint modulation = table_row[from] * p.table_ld + from / p.rows * p.step;
    float mean, inverse;
    row_statistics(from * p.x_ld, mean, inverse);
    if (row >= rows)
        return;
    vec4 lo, hi;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        if (in_row(i))
            write(row, i, lo, hi, mean, inverse, modulation);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, from * p.x_ld + sweep_col(i), lo, hi);
        write(row, i, lo, hi, mean, inverse, modulation);
    }
}
