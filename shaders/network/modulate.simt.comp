#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * (1 + scale) + shift, one workgroup a row; the mean is taken out before squaring
#extension GL_GOOGLE_include_directive : require
#include "modulate.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kHalfX = false;
layout(constant_id = 1) const bool kHalfY = false;
layout(constant_id = 2) const uint kTileM = 1;
layout(push_constant) uniform Push { ModulatePush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };             // [groups * rows, cols]
layout(binding = 1) readonly buffer Table { float table[]; };     // [timesteps, table_ld]
layout(binding = 2) readonly buffer TableRow { uint table_row[]; }; // [groups * rows]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };            // [groups * rows, cols]

#include "lib/row_norm.simt.glsl"

void main()
{
    const uint row = linear_group();
    if (row >= p.rows * p.groups)
        return;
    const uint first = gl_LocalInvocationID.x * 8, stride = 64 * 8;
    const uint in_row = row * p.x_ld;
    float mean, inverse;
    row_statistics(in_row, mean, inverse);
    vec4 lo, hi;
    const uint modulation = table_row[row] * p.table_ld + row / p.rows * p.step;
    for (uint c = first; c < p.cols; c += stride) {
        LOAD8(x, kHalfX, in_row + c, lo, hi);
        const uint scale = modulation + p.scale_col + c, shift = modulation + p.shift_col + c;
        lo = (lo - mean) * inverse * (1.0 + vec4(table[scale], table[scale + 1], table[scale + 2], table[scale + 3])) +
             vec4(table[shift], table[shift + 1], table[shift + 2], table[shift + 3]);
        hi = (hi - mean) * inverse * (1.0 + vec4(table[scale + 4], table[scale + 5], table[scale + 6], table[scale + 7])) +
             vec4(table[shift + 4], table[shift + 5], table[shift + 6], table[shift + 7]);
        clear_padding(c, p.cols, lo, hi);
        STORE8(y, kHalfY, row * p.y_ld + c, lo, hi);
    }
}
