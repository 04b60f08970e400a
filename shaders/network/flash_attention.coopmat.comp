#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v of fp16 inputs, for GPUs with matrix units: a workgroup of four subgroups holds 64 queries
// of one head. Sums in registers are why head_dim is 96 at most. tools/spirv compiles it.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#include "flash_attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 128, local_size_x_id = 33) in; // kThreads
layout(constant_id = 2) const bool kHalfY = false;
layout(constant_id = 3) const uint kChunks = 10; // head_dim / 8
layout(constant_id = 4) const uint kTileM = 64;
layout(constant_id = 5) const uint kTileN = 1;
layout(push_constant) uniform Push { FlashAttentionPush p; };
layout(binding = 0) readonly buffer Q { uvec4 q[]; };   // [batch * query_rows, q_ld], fp16
layout(binding = 1) readonly buffer Kv { uvec4 kv[]; }; // [batch * key_rows, kv_ld], fp16
layout(binding = 2) writeonly buffer Y { uvec4 y[]; };  // [batch * query_rows, y_ld]

const uint kSides = 1;

uint visible_keys(uint row, uint first)
{
    return first + 32 <= p.keys ? 0xffffffff : (1u << (p.keys - first)) - 1;
}
#include "lib/flash_tile.coopmat.glsl"

// to registers, 32 at a time
void load_all_queries(uint image, uint first, uint column)
{
    const uint last = max(p.queries, p.first_row + 1) - p.first_row - 1; // rows behind it repeat it
    [[unroll]] for (uint turn = 0; turn < 2; ++turn) {
        barrier();
        for (uint i = gl_LocalInvocationID.x; i < kKeys * kRowChunks; i += kThreads) {
            const uint row = min(first + turn * kKeys + i / kRowChunks, last), c = i % kRowChunks;
            stage_row(0, i / kRowChunks, c,
                      c < kChunks ? q[((image * p.query_rows + row) * p.q_ld + column) / 8 + c] : uvec4(0));
        }
        barrier();
        if (gl_SubgroupID / 2 == turn)
            load_queries(gl_SubgroupID % 2 * kQueries);
    }
}

// eight channels of a key or a value (`column`); zeros behind the last
uvec4 load_kv(uint image, uint key, uint column, uint c)
{
    return c < kChunks && key < p.keys ? kv[((image * p.key_rows + key) * p.kv_ld + column) / 8 + c] : uvec4(0);
}

void stage_block_keys(uint image, uint first, uint column)
{
    barrier(); // the values may still be read
    for (uint i = gl_LocalInvocationID.x; i < kKeys * kRowChunks; i += kThreads)
        stage_row(0, i / kRowChunks, i % kRowChunks, load_kv(image, first + i / kRowChunks, column, i % kRowChunks));
    barrier();
}

void stage_block_values(uint image, uint first, uint column)
{
    barrier(); // the keys may still be read
    for (uint i = gl_LocalInvocationID.x; i < kKeys / 2 * kRowChunks; i += kThreads) {
        const uint key = i % (kKeys / 2) * 2, c = i / (kKeys / 2);
        stage_values(0, key, c, load_kv(image, first + key, column, c), load_kv(image, first + key + 1, column, c));
    }
    barrier();
}

// y_at: of the image's first row in y
void store(uint first_query, uint y_at, uint head)
{
    [[dont_unroll]] for (uint piece = 0; piece < kDim / 16; ++piece) {
        own_barrier();
        put_sums(piece);
        own_barrier();
        [[unroll]] for (uint round = 0; round < kRounds; ++round) {
            const uint own = row_of(round), half_of = gl_SubgroupInvocationID % 2;
            const uint row = first_query + gl_SubgroupID * kQueries + own, c = piece * 2 + half_of;
            if (own >= kQueries || row >= p.rows || c >= kChunks)
                continue;
            const float inverse = 1.0 / total[round];
            vec4 lo, hi;
            READ8(scores, score_at + own * kScorePitch + half_of * 8, lo, hi);
            STORE8(y, kHalfY, y_at + row * p.y_ld + head + c * 8, (lo * inverse), (hi * inverse));
        }
    }
}

void main()
{
    const uint first_query = gl_WorkGroupID.x * kTileM, head = gl_WorkGroupID.y * kChunks * 8, image = gl_WorkGroupID.z;
    block_at = 0;
    score_scale = p.scale;
    start_attention();
    load_all_queries(image, first_query, p.q_col + head);
    for (uint first = 0; first < p.keys; first += kKeys) {
        stage_block_keys(image, first, p.k_col + head);
        multiply_keys();
        softmax_block(first);
        stage_block_values(image, first, p.v_col + head);
        shrink_sums();
        add_values();
    }
    store(first_query, image * p.query_rows * p.y_ld, head);
}
