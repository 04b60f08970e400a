#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(x w^T), for GPUs without matrix units: 64 x 64 or 32 x 32 outputs a workgroup of 64 threads; 16 columns of
// K at a time through shared memory, the next ones loaded into registers behind the arithmetic. 8.5 KiB of shared
// memory; needs no subgroup operation.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "gemm.h"
#include "lib/pack.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 64;
layout(constant_id = 1) const uint kTileN = 64;
layout(constant_id = 2) const uint kTypeX = kF16;
layout(constant_id = 3) const uint kTypeW = kQ8_0;
layout(push_constant) uniform Push { GemmPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; }; // [groups * rows, depth]
layout(binding = 1) readonly buffer W { uvec4 w[]; }; // [groups * cols, depth]
#include "lib/gemm_gate.glsl"
#include "lib/gemm_epilogue.glsl"
#define WEIGHT(i) w[i]
#include "lib/weight.glsl"
#include "lib/gemm_tile.simt.glsl"

// this thread's columns of the 16 from k on, of one row of x and one of w
void load(uint x_row, uint w_row, uint k, out vec4 a[4], out vec4 b[4])
{
    k += bring_k();
    [[unroll]] for (uint i = 0; i < 4; ++i)
        a[i] = b[i] = vec4(0.0);
    [[unroll]] for (uint i = 0; i < kBring / 2; ++i) {
        if (k + 8 * i >= p.depth)
            continue;
        LOAD8(x, kTypeX, x_row + k + 8 * i, a[2 * i], a[2 * i + 1]);
        load_weight8(w_row, k + 8 * i, b[2 * i], b[2 * i + 1]);
    }
}

void main()
{
    epilogue_group = gate_group = gl_WorkGroupID.z;
    const uint row = gl_WorkGroupID.x * kTileM, col = gl_WorkGroupID.y * kTileN;
    const uint x_row = (epilogue_group * p.rows + min(row + bring_row(), p.rows - 1)) * p.x_ld;
    const uint w_row = weight_row(epilogue_group * p.cols + min(col + bring_row(), p.cols - 1));
    clear_tile();
    vec4 a[4], b[4];
    load(x_row, w_row, 0, a, b);
    for (uint k = 0; k < p.depth; k += kTileK) {
        barrier();
        stage(a, b);
        barrier();
        load(x_row, w_row, k + kTileK, a, b);
        multiply();
    }
    store_tile(row, col);
}
