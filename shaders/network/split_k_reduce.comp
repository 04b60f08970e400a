#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(sum of the slices of K that workgroups of conv2d summed apart), added in order: a workgroup makes 16 rows
// of 32 columns, an invocation eight columns of a row
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "split_k_reduce.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 16;
layout(constant_id = 1) const uint kTileN = 32;
layout(constant_id = 36) const uint kSlices = 2;
layout(push_constant) uniform Push { SplitKReducePush p; };
layout(binding = 0) readonly buffer X { vec4 x[]; }; // [rows, kSlices * cols] fp32: slices beside each other
#include "lib/conv_shift.glsl"
#include "lib/gemm_epilogue.glsl"

shared vec4 finished[kTileM * kTileN / 4]; // for moments

// mean and m2 of a column, an invocation each, from the first value on, so that a large mean costs no digits
void store_column_moments(uint first_row, uint first_col)
{
    barrier();
    const uint c = gl_LocalInvocationID.x, col = first_col + c;
    if (c >= kTileN || first_row >= p.rows || col / 8 * 8 >= p.cols)
        return;
    uint count = 0;
    while (count < kMomentRows && counts_in_moments(first_row + count)) // pixels of an image are its first rows
        ++count;
    const float first = finished[c / 4][c % 4];
    float sum = 0.0, m2 = 0.0;
    for (uint i = 0; i < count; ++i)
        sum += finished[i * kTileN / 4 + c / 4][c % 4] - first;
    const float mean = sum / max(float(count), 1.0);
    for (uint i = 0; i < count; ++i) {
        const float d = finished[i * kTileN / 4 + c / 4][c % 4] - first - mean;
        m2 += d * d;
    }
    const uint at = first_row / kMomentRows * p.moments_ld + 2 * col;
    moments[at / 4][at % 4] = first + mean;
    moments[at / 4][at % 4 + 1] = m2;
}

void main()
{
    epilogue_group = 0;
    const uint first_row = gl_WorkGroupID.x * kTileM, first_col = gl_WorkGroupID.y * kTileN;
    const uint of_row = gl_LocalInvocationID.x / (kTileN / 8), eight = gl_LocalInvocationID.x % (kTileN / 8);
    const uint row = first_row + of_row, col = first_col + eight * 8, slice_ld = p.x_ld / kSlices;
    vec4 lo = vec4(0.0), hi = vec4(0.0);
    if (row < p.rows && col < p.cols) {
        for (uint slice = 0; slice < kSlices; ++slice) {
            const uint from = (row * p.x_ld + slice * slice_ld + col) / 4;
            lo += x[from];
            hi += x[from + 1];
        }
        activate8(row, col, lo, hi);
        finish8(row, col, p.cols, lo, hi);
    }
    if (kMoments) {
        finished[(of_row * kTileN + eight * 8) / 4] = lo;
        finished[(of_row * kTileN + eight * 8) / 4 + 1] = hi;
        store_column_moments(first_row, first_col);
    }
}
