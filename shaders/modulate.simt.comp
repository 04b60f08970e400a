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

shared float partial[64];

float reduce(float v) // fixed tree: the same sum whatever the subgroup size
{
    const uint t = gl_LocalInvocationID.x;
    partial[t] = v;
    barrier();
    for (uint half_size = 32; half_size > 0; half_size /= 2) {
        if (t < half_size)
            partial[t] += partial[t + half_size];
        barrier();
    }
    const float sum = partial[0];
    barrier();
    return sum;
}

float sum4(vec4 v) { return (v.x + v.y) + (v.z + v.w); }

void main()
{
    const uint row = linear_group();
    if (row >= p.rows * p.groups)
        return;
    const uint first = gl_LocalInvocationID.x * 8, stride = 64 * 8;
    const uint in_row = row * p.x_ld;
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = first; c < p.cols; c += stride) { // padding is zero
        LOAD8(x, kHalfX, in_row + c, lo, hi);
        sum += sum4(lo) + sum4(hi);
    }
    const float mean = reduce(sum) / float(p.cols);
    sum = 0.0;
    for (uint c = first; c < p.cols; c += stride) {
        LOAD8(x, kHalfX, in_row + c, lo, hi);
        lo -= mean;
        hi -= mean;
        clear_padding(c, p.cols, lo, hi);
        sum += sum4(lo * lo) + sum4(hi * hi);
    }
    const float inverse = inversesqrt(reduce(sum) / float(p.cols) + p.eps);
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
