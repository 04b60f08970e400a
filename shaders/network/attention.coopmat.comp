#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale + mask) v over both streams of a set, of fp16 inputs, for GPUs with matrix units: a workgroup
// of four subgroups holds 32 queries of one head. Two subgroups share 16 queries: one looks at the voxel stream's keys,
// the other at the semantic one's, and what they summed is joined at the end. tools/dev/spirv compiles it.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#include "attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 128, local_size_x_id = 33) in; // kThreads
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kChunks = 8; // head_dim / 8
layout(push_constant) uniform Push { AttentionPush p; };
layout(binding = 0) readonly buffer Qkv { uvec4 qkv[]; };     // [2 * rows, 3 * heads * head_dim], fp16
layout(binding = 1) readonly buffer Tiles { uvec4 tiles[]; }; // first row, rows, first row and rows of the set
layout(binding = 2) readonly buffer Mask { uint mask[]; };    // [rows, words]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };        // [streams * rows, heads * head_dim]

const uint kSides = 2;

uvec4 tile;
uint half_of_tile() { return gl_SubgroupID % 2 * 16; } // this subgroup's first query
uint query_row(uint own) { return tile.x + min(half_of_tile() + own, tile.y - 1); }

uint visible_keys(uint own, uint first) { return mask[query_row(own) * p.words + first / 32]; }
#include "lib/flash_tile.coopmat.glsl"

shared vec2 joined[4 * kQueries]; // largest score and total of each subgroup's rows

// eight channels of a row of a stream; zeros where there is none
uvec4 load_row(bool inside, uint side, uint row, uint column, uint c)
{
    return inside && c < kChunks ? qkv[((side * p.rows + row) * p.qkv_ld + column) / 8 + c] : uvec4(0);
}

void stage_queries(uint stream, uint column)
{
    for (uint i = gl_LocalInvocationID.x; i < kKeys * kRowChunks; i += kThreads) {
        const uint row = tile.x + min(i / kRowChunks, tile.y - 1);
        stage_row(0, i / kRowChunks, i % kRowChunks, load_row(true, stream, row, column, i % kRowChunks));
    }
    barrier();
}

// keys or values (`column`) of both sides
void stage_block(uint first, uint column)
{
    barrier(); // what lies there may still be read
    for (uint i = gl_LocalInvocationID.x; i < kSides * kKeys * kRowChunks; i += kThreads) {
        const uint side = i / (kKeys * kRowChunks), key = i / kRowChunks % kKeys, c = i % kRowChunks;
        stage_row(side * kBlock, key, c, load_row(first + key < tile.w, side, tile.z + first + key, column, c));
    }
    barrier();
}

// what the subgroup of the voxel stream and that of the semantic one summed for the same queries
void store(uint stream, uint head)
{
    const uint other = gl_SubgroupID + 2, other_at = other * kQueries * kScorePitch;
    [[unroll]] for (uint round = 0; round < kRounds; ++round)
        if (row_of(round) < kQueries)
            joined[gl_SubgroupID * kQueries + row_of(round)] = vec2(largest[round], total[round]);
    [[dont_unroll]] for (uint piece = 0; piece < kDim / 16; ++piece) {
        barrier();
        put_sums(piece);
        barrier();
        [[unroll]] for (uint round = 0; round < kRounds; ++round) {
            const uint own = row_of(round), part = gl_SubgroupInvocationID % 2, c = piece * 2 + part;
            if (gl_SubgroupID >= 2 || own >= kQueries || half_of_tile() + own >= tile.y || c >= kChunks)
                continue;
            const vec2 theirs = joined[other * kQueries + own];
            const float m = max(largest[round], theirs.x), a = exp2(largest[round] - m), b = exp2(theirs.x - m);
            const float inverse = 1.0 / (total[round] * a + theirs.y * b);
            const uint at = own * kScorePitch + part * 2;
            const vec4 our_lo = uintBitsToFloat(scores[score_at + at]);
            const vec4 our_hi = uintBitsToFloat(scores[score_at + at + 1]);
            const vec4 their_lo = uintBitsToFloat(scores[other_at + at]);
            const vec4 their_hi = uintBitsToFloat(scores[other_at + at + 1]);
            const vec4 lo = (our_lo * a + their_lo * b) * inverse, hi = (our_hi * a + their_hi * b) * inverse;
            STORE8(y, kTypeY, (stream * p.rows + query_row(own)) * p.y_ld + head + c * 8, lo, hi);
        }
    }
}

void main()
{
    tile = tiles[gl_WorkGroupID.x];
    const uint head = gl_WorkGroupID.y * p.head_dim, dim = p.heads * p.head_dim;
    block_at = gl_SubgroupID / 2 * kBlock;
    score_scale = p.scale * 1.44269504; // log2(e)
    start_attention();
    stage_queries(gl_WorkGroupID.z, head);
    load_queries(half_of_tile());
    for (uint first = 0; first < tile.w; first += kKeys) {
        stage_block(first, dim + head);
        multiply_keys();
        softmax_block(first);
        stage_block(first, 2 * dim + head);
        shrink_sums();
        add_values();
    }
    store(gl_WorkGroupID.z, head);
}
