#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = epilogue(x w^T) of fp16 factors, for GPUs with matrix units (VK_KHR_cooperative_matrix). tools/dev/spirv compiles it.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#include "gemm.h"
#include "lib/pack.glsl"

layout(local_size_x = 128, local_size_x_id = 33) in; // kThreads
layout(constant_id = 0) const uint kTileM = 128;
layout(constant_id = 1) const uint kTileN = 128;
layout(constant_id = 3) const uint kTypeW = kQ8_0;
layout(push_constant) uniform Push { GemmPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; }; // [groups * rows, depth], fp16
layout(binding = 1) readonly buffer W { uvec4 w[]; }; // [groups * cols, depth]
#include "lib/gemm_gate.glsl"
#include "lib/gemm_epilogue.glsl"
const uint kSlices = 1; // of K
#include "lib/gemm_tile.coopmat.glsl"
#define WEIGHT(i) w[i]
#include "lib/weight.coopmat.glsl"

uint k = 0;                        // of the next step
uint x_at[kLoadsX], w_at[kLoadsW]; // texels of the rows that this thread brings: x from its columns on

void start_loads(uint tile_row, uint tile_col)
{
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i)
        x_at[i] = ((epilogue_group * p.rows + min(tile_row + load_row(i), p.rows - 1)) * p.x_ld + load_k()) / 8;
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i)
        w_at[i] = weight_row(epilogue_group * p.cols + min(tile_col + load_row(i), p.cols - 1));
}

bool load_next()
{
    if (k >= p.depth)
        return false;
    const bool inside = kWholeSteps || k + load_k() < p.depth;
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i)
        next_x[i] = inside ? x[x_at[i] + k / 8] : uvec4(0);
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i)
        next_w[i] = inside ? load_weight_halves(w_at[i], k + load_k()) : uvec4(0);
    k += kTileK;
    return true;
}

void main()
{
    epilogue_group = gate_group = gl_WorkGroupID.z;
    const uvec2 first = tile_place() * uvec2(kTileM, kTileN);
    start_loads(first.x, first.y);
    sum_tile();
    store_tile(first.x, first.y);
}
