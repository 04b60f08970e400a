#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = (x - mean(x)) / sqrt(var(x) + eps) * scale + shift, or * (1 + scale) + shift with a row of a table for each row of x.
// 16 threads a row, four rows a workgroup. The first kKept sweeps of a row are read once and stay in registers; the mean is
// taken out before squaring.
// note: kKept <= divide_up(cols, kSweep), so of the sweeps that are kept only the last one may go beyond a row
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "row_norm.h"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kTileM = 4;
layout(constant_id = 3) const bool kModulated = false; // scale and shift are of a table
layout(constant_id = 4) const bool kAligned = false;   // their columns and rows start at multiples of 4
layout(constant_id = 5) const uint kKept = 1;
layout(push_constant) uniform Push { RowNormPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };               // [groups * rows, cols]
layout(binding = 1) readonly buffer Scale { vec4 scale[]; };        // [1, cols] or [timesteps, table_ld] fp32
layout(binding = 2) readonly buffer Shift { vec4 shift[]; };        // likewise
layout(binding = 3) readonly buffer TableRow { uint table_row[]; }; // [groups * rows], kModulated only
layout(binding = 4) writeonly buffer Y { uvec4 y[]; };              // [groups * rows, cols]

const uint kRowThreads = 16, kSweep = kRowThreads * 8, kKeptWords = kTypeX == kF16 ? 1 : 2;

uvec4 kept[kKept * kKeptWords];
shared float partial[2][64];

uint row_in_group() { return gl_LocalInvocationID.x / kRowThreads; }

// first column of this thread in a sweep
uint sweep_col(uint sweep) { return sweep * kSweep + gl_LocalInvocationID.x % kRowThreads * 8; }

bool in_row(uint sweep) { return sweep + 1 < kKept || sweep_col(sweep) < p.cols; }

void load_kept(uint sweep, out vec4 lo, out vec4 hi)
{
    LOAD8(kept, kTypeX, sweep * kKeptWords * (kTypeX == kF16 ? 8 : 4), lo, hi);
}

// every thread of a row adds the same numbers in the same order
float reduce(uint which, float v)
{
    const uint t = gl_LocalInvocationID.x, first = t - t % kRowThreads;
    partial[which][t] = v;
    barrier();
    float sum = 0.0;
    [[unroll]] for (uint i = 0; i < kRowThreads / 2; ++i)
        sum += partial[which][first + i] + partial[which][first + i + kRowThreads / 2];
    return sum;
}

float sum8(vec4 lo, vec4 hi)
{
    const vec4 v = lo + hi;
    return (v.x + v.y) + (v.z + v.w);
}

// the padding of a row
void clear_beyond(uint sweep, inout vec4 lo, inout vec4 hi)
{
    if (sweep + 1 >= kKept && sweep_col(sweep) + 8 > p.cols)
        clear_padding(sweep_col(sweep), p.cols, lo, hi);
}

float squares(uint sweep, vec4 lo, vec4 hi, float mean)
{
    lo -= mean;
    hi -= mean;
    clear_beyond(sweep, lo, hi);
    return sum8(lo * lo, hi * hi);
}

// first: element of X with which the row starts. All threads of the workgroup must come here.
void row_statistics(uint first, out float mean, out float inverse)
{
    vec4 lo, hi;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        const uint at = (first + sweep_col(i)) / (kTypeX == kF16 ? 8 : 4);
        [[unroll]] for (uint w = 0; w < kKeptWords; ++w) {
            kept[i * kKeptWords + w] = uvec4(0);
            if (in_row(i))
                kept[i * kKeptWords + w] = x[at + w];
        }
    }
    float sum = 0.0; // padding is zero
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        sum += sum8(lo, hi);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, first + sweep_col(i), lo, hi);
        sum += sum8(lo, hi);
    }
    mean = reduce(0, sum) / float(p.cols);
    sum = 0.0;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        sum += squares(i, lo, hi, mean);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, first + sweep_col(i), lo, hi);
        sum += squares(i, lo, hi, mean);
    }
    inverse = inversesqrt(reduce(1, sum) / float(p.cols) + p.eps);
}

// columns of a table start anywhere where its width is not a multiple of 4
vec4 from_column(uint at, vec4 a, vec4 b)
{
    return at % 4 == 1 ? vec4(a.yzw, b.x) : at % 4 == 2 ? vec4(a.zw, b.xy) : vec4(a.w, b.xyz);
}
#define LOAD4(words, at, v)                                                                                                \
    v = words[(at) / 4];                                                                                               \
    if (!kAligned && (at) % 4 != 0)                                                                                    \
        v = from_column(at, v, words[(at) / 4 + 1]);

void affine4(uint at, inout vec4 v)
{
    vec4 factor, offset;
    LOAD4(scale, at + p.scale_col, factor)
    LOAD4(shift, at + p.shift_col, offset)
    if (kModulated)
        factor += 1.0;
    v = v * factor + offset;
}

// table_at: element of the table with which the row of this row begins
void write(uint row, uint sweep, vec4 lo, vec4 hi, float mean, float inverse, uint table_at)
{
    const uint c = sweep_col(sweep);
    lo = (lo - mean) * inverse;
    hi = (hi - mean) * inverse;
    affine4(table_at + c, lo);
    affine4(table_at + c + 4, hi);
    clear_beyond(sweep, lo, hi);
    STORE8(y, kTypeY, row * p.y_ld + c, lo, hi);
}

void main()
{
    const uint rows = p.rows * p.groups, row = linear_group() * kTileM + row_in_group(), from = min(row, rows - 1);
    uint table_at = 0;
    if (kModulated)
        table_at = table_row[from] * p.table_ld + from / p.rows * p.step;
    float mean, inverse;
    row_statistics(from * p.x_ld, mean, inverse);
    if (row >= rows)
        return;
    vec4 lo, hi;
    [[unroll]] for (uint i = 0; i < kKept; ++i) {
        load_kept(i, lo, hi);
        if (in_row(i))
            write(row, i, lo, hi, mean, inverse, table_at);
    }
    for (uint i = kKept; in_row(i); ++i) {
        LOAD8(x, kTypeX, from * p.x_ld + sweep_col(i), lo, hi);
        write(row, i, lo, hi, mean, inverse, table_at);
    }
}
