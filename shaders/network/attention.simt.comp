#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale + mask) v over both streams of a set, online over blocks of 16 keys; for GPUs: a workgroup
// holds 32 queries of one head, two threads a query; keys, then values, of a block go through the same shared memory
// (8 KiB at head_dim 128). Needs no subgroup operation.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeQkv = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kChunks = 8; // head_dim / 8
layout(push_constant) uniform Push { AttentionPush p; };
layout(binding = 0) readonly buffer Qkv { uvec4 qkv[]; };     // [2 * rows, 3 * heads * head_dim]: voxel, semantic stream
layout(binding = 1) readonly buffer Tiles { uvec4 tiles[]; }; // first row, rows, first row and rows of the set
layout(binding = 2) readonly buffer Mask { uint mask[]; };    // [rows, words]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };        // [streams * rows, heads * head_dim]

const uint kQueries = 32;
const uint kKeys = 16;
const uint kOwned = (kChunks + 1) / 2; // chunks of the output that each of a query's two threads sums, by turns
const uint kPitch = 2 * kChunks + 1;   // of a key: odd, so that the keys of two threads lie in different banks

shared vec4 block[kKeys * kPitch];
shared float weights[kQueries * (kKeys + 1)];

// rows [first, first + kKeys) of keys or values (`column`), clamped to the set
void stage(uint side, uint set_first, uint first, uint set_rows, uint column)
{
    for (uint i = gl_LocalInvocationID.x; i < kKeys * kChunks; i += 64) {
        const uint key = min(first + i / kChunks, set_rows - 1);
        vec4 lo, hi;
        LOAD8(qkv, kTypeQkv, (side * p.rows + set_first + key) * p.qkv_ld + column + i % kChunks * 8, lo, hi);
        const uint at = i / kChunks * kPitch + i % kChunks * 2;
        block[at] = lo;
        block[at + 1] = hi;
    }
}

void main()
{
    const uint thread = gl_LocalInvocationID.x, query = thread / 2, part = thread % 2;
    const uvec4 tile = tiles[gl_WorkGroupID.x];
    const uint head = gl_WorkGroupID.y, stream = gl_WorkGroupID.z, dim = p.heads * p.head_dim;
    const uint row = tile.x + min(query, tile.y - 1);
    const uint q_at = (stream * p.rows + row) * p.qkv_ld + head * p.head_dim;
    float largest = -1e30, total = 0.0;
    vec4 o_lo[kOwned], o_hi[kOwned];
    [[unroll]] for (uint c = 0; c < kOwned; ++c)
        o_lo[c] = o_hi[c] = vec4(0.0);
    for (uint side = 0; side < 2; ++side) {
        for (uint first = 0; first < tile.w; first += kKeys) {
            const uint bits = mask[row * p.words + first / 32] >> first % 32 & 0xffff;
            barrier();
            stage(side, tile.z, first, tile.w, dim + head * p.head_dim);
            barrier();
            float s[kKeys / 2]; // this thread's half of the keys, every other one
            [[unroll]] for (uint j = 0; j < kKeys / 2; ++j)
                s[j] = 0.0;
            for (uint c = 0; c < kChunks; ++c) {
                vec4 lo, hi;
                LOAD8(qkv, kTypeQkv, q_at + c * 8, lo, hi);
                [[unroll]] for (uint j = 0; j < kKeys / 2; ++j) {
                    const uint at = (2 * j + part) * kPitch + 2 * c;
                    s[j] += dot(lo, block[at]) + dot(hi, block[at + 1]);
                }
            }
            [[unroll]] for (uint j = 0; j < kKeys / 2; ++j)
                weights[query * (kKeys + 1) + 2 * j + part] = s[j] * p.scale;
            barrier();
            stage(side, tile.z, first, tile.w, 2 * dim + head * p.head_dim);
            float m = largest;
            for (uint j = 0; j < kKeys; ++j)
                if ((bits >> j & 1) != 0)
                    m = max(m, weights[query * (kKeys + 1) + j]);
            const float shrink = exp(largest - m);
            total *= shrink;
            largest = m;
            [[unroll]] for (uint c = 0; c < kOwned; ++c) {
                o_lo[c] *= shrink;
                o_hi[c] *= shrink;
            }
            barrier();
            for (uint j = 0; j < kKeys; ++j) {
                if ((bits >> j & 1) == 0)
                    continue;
                const float w = exp(weights[query * (kKeys + 1) + j] - m);
                total += w;
                [[unroll]] for (uint c = 0; c < kOwned; ++c) {
                    const uint at = j * kPitch + 2 * min(2 * c + part, kChunks - 1);
                    o_lo[c] += w * block[at];
                    o_hi[c] += w * block[at + 1];
                }
            }
        }
    }
    if (query >= tile.y)
        return;
    const uint to = (stream * p.rows + row) * p.y_ld + head * p.head_dim;
    [[unroll]] for (uint c = 0; c < kOwned; ++c)
        if (2 * c + part < kChunks)
            STORE8(y, kTypeY, to + (2 * c + part) * 8, (o_lo[c] / total), (o_hi[c] / total));
}
