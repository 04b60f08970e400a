#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(x w^T), for GPUs without matrix units: 64 x 64 outputs a workgroup of 64 threads, 8 x 8 each; 16 columns
// of K at a time through shared memory, the next ones loaded into registers behind the arithmetic. 8.5 KiB of shared
// memory; needs no subgroup operation.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "gemm.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 64;
layout(constant_id = 1) const uint kTileN = 64;
layout(constant_id = 2) const bool kHalfX = false; // w has the type of x
layout(push_constant) uniform Push { GemmPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; }; // [groups * rows, depth]
layout(binding = 1) readonly buffer W { uvec4 w[]; }; // [groups * cols, depth]
#include "lib/gemm_epilogue.glsl"

const uint kStep = 16; // columns of K in shared memory
const uint kPitch = 68; // floats of a row of 64; keeps vec4 alignment and spreads the transposing stores over banks
shared float tile_x[kStep * kPitch]; // [k][row]
shared float tile_w[kStep * kPitch]; // [k][col]

// each thread stages one row of both tiles
void load(uint x_row, uint w_row, uint k, out vec4 a[4], out vec4 b[4])
{
    [[unroll]] for (uint i = 0; i < 4; ++i)
        a[i] = b[i] = vec4(0.0);
    if (kHalfX) {
        [[unroll]] for (uint i = 0; i < 2; ++i) {
            if (k + 8 * i >= p.depth)
                continue;
            unpack8(x[(x_row + k) / 8 + i], a[2 * i], a[2 * i + 1]);
            unpack8(w[(w_row + k) / 8 + i], b[2 * i], b[2 * i + 1]);
        }
    } else {
        [[unroll]] for (uint i = 0; i < 4; ++i) {
            if (k + 4 * i >= p.depth)
                continue;
            a[i] = uintBitsToFloat(x[(x_row + k) / 4 + i]);
            b[i] = uintBitsToFloat(w[(w_row + k) / 4 + i]);
        }
    }
}

void main()
{
    const uint thread = gl_LocalInvocationID.x;
    const uint group = gl_WorkGroupID.z;
    const uint row = gl_WorkGroupID.x * kTileM, col = gl_WorkGroupID.y * kTileN;
    const uint x_row = (group * p.rows + min(row + thread, p.rows - 1)) * p.x_ld;
    const uint w_row = (group * p.cols + min(col + thread, p.cols - 1)) * p.w_ld;
    const uint tm = thread / 8 * 8, tn = thread % 8 * 8;
    float acc[8][8];
    [[unroll]] for (uint i = 0; i < 8; ++i)
        [[unroll]] for (uint j = 0; j < 8; ++j)
            acc[i][j] = 0.0;
    vec4 a[4], b[4];
    load(x_row, w_row, 0, a, b);
    for (uint k = 0; k < p.depth; k += kStep) {
        barrier();
        [[unroll]] for (uint i = 0; i < kStep; ++i) {
            tile_x[i * kPitch + thread] = a[i / 4][i % 4];
            tile_w[i * kPitch + thread] = b[i / 4][i % 4];
        }
        barrier();
        load(x_row, w_row, k + kStep, a, b);
        [[unroll]] for (uint s = 0; s < kStep; ++s) {
            float u[8], v[8];
            [[unroll]] for (uint i = 0; i < 8; ++i) {
                u[i] = tile_x[s * kPitch + tm + i];
                v[i] = tile_w[s * kPitch + tn + i];
            }
            [[unroll]] for (uint i = 0; i < 8; ++i)
                [[unroll]] for (uint j = 0; j < 8; ++j)
                    acc[i][j] += u[i] * v[j];
        }
    }
    [[unroll]] for (uint i = 0; i < 8; ++i)
        store8(group, row + tm + i, col + tn, vec4(acc[i][0], acc[i][1], acc[i][2], acc[i][3]),
               vec4(acc[i][4], acc[i][5], acc[i][6], acc[i][7]));
}
