#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v, online over blocks of 32 keys; for GPUs: a workgroup holds 32 queries of one head, eight
// threads a group of queries; keys, then values, go through shared memory 64 channels at a time, so that it holds 15.4
// KiB at any head_dim. A thread sums 64 elements of y at most: above 256 channels the queries take two turns. Heads of
// 40 and fewer have a way of their own (lib/flash_narrow.simt.glsl). Needs no subgroup operation.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "flash_attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kTypeQ = kF16;
layout(constant_id = 1) const uint kTypeKv = kF16;
layout(constant_id = 2) const uint kTypeY = kF16;
layout(constant_id = 3) const uint kChunks = 64; // head_dim / 8
layout(constant_id = 4) const uint kTileM = 32;
layout(constant_id = 5) const uint kTileN = 1;
layout(push_constant) uniform Push { FlashAttentionPush p; };
layout(binding = 0) readonly buffer Q { uvec4 q[]; };    // [batch * query_rows, q_ld]
layout(binding = 1) readonly buffer Kv { uvec4 kv[]; };  // [batch * key_rows, kv_ld]
layout(binding = 2) writeonly buffer Y { uvec4 y[]; };   // [batch * query_rows, y_ld]

const uint kThreads = 128;
const uint kParts = 8; // threads of a query: each has every eighth key of a block and every eighth chunk of y
const uint kKeys = 32;
const uint kOwnKeys = kKeys / kParts;
const uint kTurns = kChunks > 32 ? 2 : 1;
const uint kQueries = 32 / kTurns;
const uint kOwn = kQueries * kParts / kThreads; // queries of a thread
const uint kSlab = 8;                           // chunks
const uint kSlabs = (kChunks + kSlab - 1) / kSlab;
const uint kPitch = kSlab + 1; // rows of a slab start in different banks

const uint kUpper = kKeys * kPitch; // upper halves of chunks lie behind the lower ones
const uint kMostNarrow = 5;         // chunks of heads that go the way of lib/flash_narrow.simt.glsl

shared vec4 slabs[4 * kKeys * kMostNarrow]; // and 2 kUpper are fewer
shared float weights[kKeys * 33]; // [key][query]; 33, not 32: rows start in different banks
shared float part_largest[32 * (kParts + 1)];

// where a query's columns start; rows behind the last one repeat it
uint query_at(uint query)
{
    const uint last = max(p.queries, p.first_row + 1) - p.first_row - 1;
    return (gl_WorkGroupID.z * p.query_rows + min(query, last)) * p.q_ld + p.q_col;
}

// chunks of a slab of keys or values (`column`), rows [first, first + kKeys), clamped to the image's
void stage(uint first, uint column, uint slab)
{
    const uint chunks = min(kSlab, kChunks - slab * kSlab);
    barrier(); // the last one may still be read
    for (uint i = gl_LocalInvocationID.x; i < kKeys * chunks; i += kThreads) {
        const uint key = i / chunks, c = i % chunks;
        const uint row = gl_WorkGroupID.z * p.key_rows + min(first + key, p.keys - 1);
        vec4 lo, hi;
        LOAD8(kv, kTypeKv, row * p.kv_ld + column + (slab * kSlab + c) * 8, lo, hi);
        slabs[key * kPitch + c] = lo;
        slabs[kUpper + key * kPitch + c] = hi;
    }
    barrier();
}

void scores(uint first, uint column, uint q_at[kOwn], uint part, out float s[kOwn][kOwnKeys])
{
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j)
            s[n][j] = 0.0;
    for (uint slab = 0; slab < kSlabs; ++slab) {
        stage(first, column, slab);
        for (uint c = 0; c < min(kSlab, kChunks - slab * kSlab); ++c) {
            vec4 lo[kOwn], hi[kOwn];
            [[unroll]] for (uint n = 0; n < kOwn; ++n)
                LOAD8(q, kTypeQ, q_at[n] + (slab * kSlab + c) * 8, lo[n], hi[n]);
            [[unroll]] for (uint j = 0; j < kOwnKeys; ++j) {
                const uint at = (part + j * kParts) * kPitch + c;
                [[unroll]] for (uint n = 0; n < kOwn; ++n)
                    s[n][j] += dot(lo[n], slabs[at]) + dot(hi[n], slabs[kUpper + at]);
            }
        }
    }
    [[unroll]] for (uint n = 0; n < kOwn; ++n)
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j)
            s[n][j] = first + part + j * kParts < p.keys ? s[n][j] * p.scale : -1e30;
}

float largest_of(uint query)
{
    float m = part_largest[query * (kParts + 1)];
    [[unroll]] for (uint i = 1; i < kParts; ++i)
        m = max(m, part_largest[query * (kParts + 1) + i]);
    return m;
}

// weights of the block in shared memory; total sums this thread's keys only
void softmax_block(uint query, uint part, float s[kOwn][kOwnKeys], inout float largest[kOwn], inout float total[kOwn],
                   out float shrink[kOwn])
{
    [[unroll]] for (uint n = 0; n < kOwn; ++n) {
        float m = largest[n];
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j)
            m = max(m, s[n][j]);
        part_largest[(query + n) * (kParts + 1) + part] = m;
    }
    barrier();
    [[unroll]] for (uint n = 0; n < kOwn; ++n) {
        const float m = largest_of(query + n);
        shrink[n] = exp2(largest[n] - m);
        largest[n] = m;
        total[n] *= shrink[n];
        [[unroll]] for (uint j = 0; j < kOwnKeys; ++j) {
            const float w = exp2(s[n][j] - m);
            weights[(part + j * kParts) * 33 + query + n] = w;
            total[n] += w;
        }
    }
}

float sum_of_parts(uint query, uint part, float total)
{
    barrier();
    part_largest[query * (kParts + 1) + part] = total;
    barrier();
    float sum = 0.0;
    [[unroll]] for (uint i = 0; i < kParts; ++i)
        sum += part_largest[query * (kParts + 1) + i];
    return sum;
}

void attend(uint first_query)
{
    const uint part = gl_LocalInvocationID.x % kParts, query = gl_LocalInvocationID.x / kParts * kOwn;
    const uint head = gl_WorkGroupID.y * kChunks * 8, image = gl_WorkGroupID.z;
    uint q_at[kOwn];
    float largest[kOwn], total[kOwn], shrink[kOwn], s[kOwn][kOwnKeys];
    vec4 o_lo[kSlabs][kOwn], o_hi[kSlabs][kOwn];
    [[unroll]] for (uint n = 0; n < kOwn; ++n) {
        q_at[n] = query_at(first_query + query + n) + head;
        largest[n] = -1e30;
        total[n] = 0.0;
        [[unroll]] for (uint slab = 0; slab < kSlabs; ++slab)
            o_lo[slab][n] = o_hi[slab][n] = vec4(0.0);
    }
    for (uint first = 0; first < p.keys; first += kKeys) {
        scores(first, p.k_col + head, q_at, part, s);
        softmax_block(query, part, s, largest, total, shrink);
        [[unroll]] for (uint slab = 0; slab < kSlabs; ++slab) {
            stage(first, p.v_col + head, slab);
            [[unroll]] for (uint n = 0; n < kOwn; ++n) {
                o_lo[slab][n] *= shrink[n];
                o_hi[slab][n] *= shrink[n];
            }
            for (uint j = 0; j < kKeys; ++j)
                [[unroll]] for (uint n = 0; n < kOwn; ++n) {
                    const float w = weights[j * 33 + query + n];
                    o_lo[slab][n] += w * slabs[j * kPitch + part];
                    o_hi[slab][n] += w * slabs[kUpper + j * kPitch + part];
                }
        }
    }
    [[unroll]] for (uint n = 0; n < kOwn; ++n) {
        const float inverse = 1.0 / sum_of_parts(query + n, part, total[n]);
        const uint row = first_query + query + n;
        [[unroll]] for (uint slab = 0; slab < kSlabs; ++slab) {
            const uint c = slab * kSlab + part;
            if (row < p.rows && c < kChunks)
                STORE8(y, kTypeY, (image * p.query_rows + row) * p.y_ld + head + c * 8, (o_lo[slab][n] * inverse),
                       (o_hi[slab][n] * inverse));
        }
    }
}

#include "lib/flash_narrow.simt.glsl"

void main()
{
    if (kChunks <= kMostNarrow) {
        attend_narrow(gl_WorkGroupID.x * kTileM);
        return;
    }
    [[unroll]] for (uint turn = 0; turn < kTurns; ++turn)
        attend(gl_WorkGroupID.x * kTileM + turn * kQueries);
}
