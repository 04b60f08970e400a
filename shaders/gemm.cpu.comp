#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(x w^T), for devices that are CPUs: no shared memory, no barrier; x and w come through texel buffers,
// the fastest loads of lavapipe (spec/performance.md); K unrolled by a texel; each lane owns 16 x 16 outputs and a
// subgroup of 8 lanes, as 2 x 4, covers 32 x 64. Correct at any subgroup size.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "gemm.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTileM = 32;
layout(constant_id = 1) const uint kTileN = 64;
layout(constant_id = 2) const bool kHalfX = false; // w has the type of x
layout(push_constant) uniform Push { GemmPush p; };
layout(binding = 0) uniform usamplerBuffer X; // [groups * rows, depth]
layout(binding = 1) uniform usamplerBuffer W; // [groups * cols, depth]
#include "lib/gemm_epilogue.glsl"

const uint kRows = 16;
const uint kCols = 16;

float acc[kRows][kCols];

void multiply_half(uint x_at[kRows], uint w_at[kCols], uint k)
{
    vec4 a_lo[kRows], a_hi[kRows];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        unpack8(texelFetch(X, int(x_at[i] + k)), a_lo[i], a_hi[i]);
    [[unroll]] for (uint j = 0; j < kCols; ++j) {
        vec4 lo, hi;
        unpack8(texelFetch(W, int(w_at[j] + k)), lo, hi);
        [[unroll]] for (uint i = 0; i < kRows; ++i) {
            float s = acc[i][j];
            s += a_lo[i].x * lo.x;
            s += a_lo[i].y * lo.y;
            s += a_lo[i].z * lo.z;
            s += a_lo[i].w * lo.w;
            s += a_hi[i].x * hi.x;
            s += a_hi[i].y * hi.y;
            s += a_hi[i].z * hi.z;
            s += a_hi[i].w * hi.w;
            acc[i][j] = s;
        }
    }
}

void multiply_float(uint x_at[kRows], uint w_at[kCols], uint k)
{
    vec4 a[kRows];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        a[i] = uintBitsToFloat(texelFetch(X, int(x_at[i] + k)));
    [[unroll]] for (uint j = 0; j < kCols; ++j) {
        const vec4 b = uintBitsToFloat(texelFetch(W, int(w_at[j] + k)));
        [[unroll]] for (uint i = 0; i < kRows; ++i) {
            float s = acc[i][j];
            s += a[i].x * b.x;
            s += a[i].y * b.y;
            s += a[i].z * b.z;
            s += a[i].w * b.w;
            acc[i][j] = s;
        }
    }
}

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    const uint group = gl_WorkGroupID.z;
    const uint row = gl_WorkGroupID.x * kTileM + lane / 4 * kRows;
    const uint col = gl_WorkGroupID.y * kTileN + lane % 4 * kCols;
    const uint width = kHalfX ? 8 : 4; // elements of a texel
    uint x_at[kRows], w_at[kCols];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        x_at[i] = (group * p.rows + min(row + i, p.rows - 1)) * (p.x_ld / width);
    [[unroll]] for (uint j = 0; j < kCols; ++j)
        w_at[j] = (group * p.cols + min(col + j, p.cols - 1)) * (p.w_ld / width);
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        [[unroll]] for (uint j = 0; j < kCols; ++j)
            acc[i][j] = 0.0;
    if (kHalfX) {
        for (uint k = 0; k < p.depth / 8; ++k)
            multiply_half(x_at, w_at, k);
    } else {
        for (uint k = 0; k < p.depth / 4; ++k)
            multiply_float(x_at, w_at, k);
    }
    // through memory, so that the epilogue is compiled once and not once per eight outputs: a third of the compile time
    float tile[kRows * kCols];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        [[unroll]] for (uint j = 0; j < kCols; ++j)
            tile[i * kCols + j] = acc[i][j];
    [[dont_unroll]] for (uint at = 0; at < kRows * kCols; at += 8)
        store8(group, row + at / kCols, col + at % kCols, vec4(tile[at], tile[at + 1], tile[at + 2], tile[at + 3]),
               vec4(tile[at + 4], tile[at + 5], tile[at + 6], tile[at + 7]));
}
