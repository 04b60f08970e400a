#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(x w^T), for devices that are CPUs: no shared memory, no barrier; x and w come through texel buffers,
// the fastest loads of lavapipe (docs/lab/benchmarks.md); K unrolled by 8 columns; each lane owns 16 x 16 outputs, and
// p.col_lanes of them lie side by side. Correct at any subgroup size.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "gemm.h"
#include "lib/pack.glsl"

layout(local_size_x = 8) in; // lanes, as vectors of 256 bits have
layout(constant_id = 2) const uint kTypeX = kF16;
layout(constant_id = 3) const uint kTypeW = kQ8_0;
layout(push_constant) uniform Push { GemmPush p; };
layout(binding = 0) uniform usamplerBuffer X; // [groups * rows, depth]
layout(binding = 1) uniform usamplerBuffer W; // [groups * cols, depth]
#include "lib/gemm_gate.glsl"
#include "lib/gemm_epilogue.glsl"
#define WEIGHT(i) texelFetch(W, int(i))
#include "lib/weight.glsl"
#include "lib/gemm_tile.cpu.glsl"

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    epilogue_group = gate_group = gl_WorkGroupID.z;
    const uint row = gl_WorkGroupID.x * (gl_WorkGroupSize.x / p.col_lanes * kRows) + lane / p.col_lanes * kRows;
    const uint col = gl_WorkGroupID.y * (p.col_lanes * kCols) + lane % p.col_lanes * kCols;
    uint x_at[kRows], w_at[kCols];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        x_at[i] = (epilogue_group * p.rows + min(row + i, p.rows - 1)) * p.x_ld;
    [[unroll]] for (uint j = 0; j < kCols; ++j)
        w_at[j] = weight_row(epilogue_group * p.cols + min(col + j, p.cols - 1));
    clear_tile();
    for (uint k = 0; k < p.depth; k += 8) {
        vec4 lo[kRows], hi[kRows];
        [[unroll]] for (uint i = 0; i < kRows; ++i)
            FETCH8(X, kTypeX, x_at[i] + k, lo[i], hi[i])
        multiply(lo, hi, w_at, k);
    }
    store_tile(row, col);
}
