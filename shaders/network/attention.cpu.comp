#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale + mask) v over both streams of a set, online over blocks of 8 keys; for devices that are
// CPUs: 8 lanes with 4 queries each share the loads of keys and values, which come through a texel buffer; no shared
// memory. Blocks of keys that no query of a lane sees are skipped.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kTypeQkv = kF16;
layout(constant_id = 1) const uint kTypeY = kF16;
layout(constant_id = 2) const uint kChunks = 8; // head_dim / 8
layout(push_constant) uniform Push { AttentionPush p; };
layout(binding = 0) uniform usamplerBuffer Qkv;              // [2 * rows, 3 * heads * head_dim]: voxel, semantic stream
layout(binding = 1) readonly buffer Tiles { uvec4 tiles[]; }; // first row, rows, first row and rows of the set
layout(binding = 2) readonly buffer Mask { uint mask[]; };   // [rows, words]
layout(binding = 3) writeonly buffer Y { uvec4 y[]; };       // [streams * rows, heads * head_dim]

const uint kQueries = 4;
const uint kKeys = 8;

void load(uint at, out vec4 lo, out vec4 hi) { FETCH8(Qkv, kTypeQkv, at, lo, hi) }

float s[kQueries][kKeys];
float largest[kQueries], total[kQueries];
vec4 o_lo[kQueries][kChunks], o_hi[kQueries][kChunks];

void scores(uint q_at[kQueries], uint k_at[kKeys])
{
    [[unroll]] for (uint q = 0; q < kQueries; ++q)
        [[unroll]] for (uint j = 0; j < kKeys; ++j)
            s[q][j] = 0.0;
    for (uint c = 0; c < kChunks * 8; c += 8) {
        vec4 q_lo[kQueries], q_hi[kQueries];
        [[unroll]] for (uint q = 0; q < kQueries; ++q)
            load(q_at[q] + c, q_lo[q], q_hi[q]);
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            vec4 lo, hi;
            load(k_at[j] + c, lo, hi);
            [[unroll]] for (uint q = 0; q < kQueries; ++q)
                s[q][j] += dot(q_lo[q], lo) + dot(q_hi[q], hi);
        }
    }
}

// scores become weights; what was summed before is scaled to the new largest score
void softmax_block(uint bits[kQueries])
{
    [[unroll]] for (uint q = 0; q < kQueries; ++q) {
        float m = largest[q];
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            s[q][j] = (bits[q] >> j & 1) != 0 ? s[q][j] * p.scale : -1e30;
            m = max(m, s[q][j]);
        }
        const float shrink = exp(largest[q] - m);
        float sum = total[q] * shrink;
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            s[q][j] = (bits[q] >> j & 1) != 0 ? exp(s[q][j] - m) : 0.0;
            sum += s[q][j];
        }
        [[unroll]] for (uint c = 0; c < kChunks; ++c) {
            o_lo[q][c] *= shrink;
            o_hi[q][c] *= shrink;
        }
        total[q] = sum;
        largest[q] = m;
    }
}

void main()
{
    const uvec4 tile = tiles[gl_WorkGroupID.x];
    const uint head = gl_WorkGroupID.y, stream = gl_WorkGroupID.z, dim = p.heads * p.head_dim;
    uint local[kQueries], q_at[kQueries];
    [[unroll]] for (uint q = 0; q < kQueries; ++q) {
        local[q] = tile.x + min(gl_LocalInvocationID.x + 8 * q, tile.y - 1);
        q_at[q] = (stream * p.rows + local[q]) * p.qkv_ld + head * p.head_dim;
        largest[q] = -1e30;
        total[q] = 0.0;
        [[unroll]] for (uint c = 0; c < kChunks; ++c)
            o_lo[q][c] = o_hi[q][c] = vec4(0.0);
    }
    for (uint side = 0; side < 2; ++side) {
        for (uint first = 0; first < tile.w; first += kKeys) {
            uint bits[kQueries], any = 0, k_at[kKeys];
            [[unroll]] for (uint q = 0; q < kQueries; ++q) {
                bits[q] = mask[local[q] * p.words + first / 32] >> first % 32 & 0xff;
                any |= bits[q];
            }
            if (any == 0)
                continue;
            [[unroll]] for (uint j = 0; j < kKeys; ++j)
                k_at[j] = (side * p.rows + tile.z + min(first + j, tile.w - 1)) * p.qkv_ld + dim + head * p.head_dim;
            scores(q_at, k_at);
            softmax_block(bits);
            [[unroll]] for (uint c = 0; c < kChunks; ++c)
                [[unroll]] for (uint j = 0; j < kKeys; ++j) {
                    vec4 lo, hi;
                    load(k_at[j] + dim + c * 8, lo, hi);
                    [[unroll]] for (uint q = 0; q < kQueries; ++q) {
                        o_lo[q][c] += s[q][j] * lo;
                        o_hi[q][c] += s[q][j] * hi;
                    }
                }
        }
    }
    [[unroll]] for (uint q = 0; q < kQueries; ++q) {
        if (gl_LocalInvocationID.x + 8 * q >= tile.y)
            continue;
        const uint to = (stream * p.rows + local[q]) * p.y_ld + head * p.head_dim;
        [[unroll]] for (uint c = 0; c < kChunks; ++c)
            STORE8(y, kTypeY, to + c * 8, (o_lo[q][c] / total[q]), (o_hi[q][c] / total[q]));
    }
}
