#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * scale + shift, or * (1 + scale) + shift with a row of a table for each row of x,
// for devices that are CPUs: one row a lane, loads through texel buffers, no shared memory; the mean is taken out before
// squaring
#extension GL_GOOGLE_include_directive : require
#include "row_norm.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 8;
layout(constant_id = 3) const bool kModulated = false; // scale and shift are of a table
layout(constant_id = 4) const bool kAligned = false;   // their columns and rows start at multiples of 4
layout(push_constant) uniform Push { RowNormPush p; };
layout(binding = 0) uniform usamplerBuffer X;                       // [groups * rows, cols]
layout(binding = 1) uniform usamplerBuffer Scale;                   // [1, cols] or [timesteps, table_ld] fp32
layout(binding = 2) uniform usamplerBuffer Shift;                   // likewise
layout(binding = 3) readonly buffer TableRow { uint table_row[]; }; // [groups * rows], kModulated only
layout(binding = 4) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols]

void load_x(uint at, out vec4 lo, out vec4 hi) { FETCH8(X, kTypeX, at, lo, hi) }

float sum4(vec4 v) { return (v.x + v.y) + (v.z + v.w); }

void row_statistics(uint in_row, out float mean, out float inverse)
{
    vec4 lo, hi;
    float sum = 0.0;
    for (uint c = 0; c < p.cols; c += 8) { // padding is zero
        load_x(in_row + c, lo, hi);
        sum += sum4(lo) + sum4(hi);
    }
    mean = sum / float(p.cols);
    sum = 0.0;
    for (uint c = 0; c < p.cols; c += 8) {
        load_x(in_row + c, lo, hi);
        lo -= mean;
        hi -= mean;
        clear_padding(c, p.cols, lo, hi);
        sum += sum4(lo * lo) + sum4(hi * hi);
    }
    inverse = inversesqrt(sum / float(p.cols) + p.eps);
}

// columns of a table start anywhere where its width is not a multiple of 4
vec4 from_column(uint at, vec4 a, vec4 b)
{
    return at % 4 == 1 ? vec4(a.yzw, b.x) : at % 4 == 2 ? vec4(a.zw, b.xy) : vec4(a.w, b.xyz);
}
#define LOAD4(words, at, v)                                                                                                \
    v = uintBitsToFloat(texelFetch(words, int((at) / 4)));                                                             \
    if (!kAligned && (at) % 4 != 0)                                                                                    \
        v = from_column(at, v, uintBitsToFloat(texelFetch(words, int((at) / 4 + 1))));

void affine4(uint at, inout vec4 v)
{
    vec4 factor, offset;
    LOAD4(Scale, at + p.scale_col, factor)
    LOAD4(Shift, at + p.shift_col, offset)
    if (kModulated)
        factor += 1.0;
    v = v * factor + offset;
}

void main()
{
    const uint row = linear_thread(), in_row = row * p.x_ld;
    if (row >= p.rows * p.groups)
        return;
    uint table_at = 0;
    if (kModulated)
        table_at = table_row[row] * p.table_ld + row / p.rows * p.step;
    float mean, inverse;
    row_statistics(in_row, mean, inverse);
    for (uint c = 0; c < p.cols; c += 8) {
        vec4 lo, hi;
        load_x(in_row + c, lo, hi);
        lo = (lo - mean) * inverse;
        hi = (hi - mean) * inverse;
        affine4(table_at + c, lo);
        affine4(table_at + c + 4, hi);
        clear_padding(c, p.cols, lo, hi);
        STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
    }
}
