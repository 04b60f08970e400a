#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v, online over blocks of 32 keys; for devices that are CPUs: every lane owns queries, so
// that nothing is exchanged; loads come through texel buffers; eight channels of a block are unrolled.
// note: the sums of y are indexed by a loop and therefore live in memory, where lavapipe moves them lane by lane: 32
// keys pay for one such move. With 16 it reaches 0.7 of the speed; unrolling the channels takes minutes to compile.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "flash_attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 8) in; // lanes, as vectors of 256 bits have
layout(constant_id = 0) const uint kTypeQ = kF16;
layout(constant_id = 1) const uint kTypeKv = kF16;
layout(constant_id = 2) const uint kTypeY = kF16;
layout(constant_id = 3) const uint kMostChunks = 20; // room for head_dim / 8, in few sizes: compiling takes seconds
layout(push_constant) uniform Push { FlashAttentionPush p; };
layout(binding = 0) uniform usamplerBuffer Q;          // [batch * query_rows, q_ld]
layout(binding = 1) uniform usamplerBuffer Kv;         // [batch * key_rows, kv_ld]
layout(binding = 2) writeonly buffer Y { uvec4 y[]; }; // [batch * query_rows, y_ld]

layout(constant_id = 34) const uint kQueries = 8; // of a lane: 4 or 8
const uint kKeys = 32;

float s[kQueries][kKeys]; // scores of a block, then their exponentials
float largest[kQueries], total[kQueries], shrink[kQueries];
vec4 o_lo[kMostChunks][kQueries], o_hi[kMostChunks][kQueries];

void load_q(uint at, out vec4 lo, out vec4 hi) { FETCH8(Q, kTypeQ, at, lo, hi) }

void load_kv(uint at, out vec4 lo, out vec4 hi) { FETCH8(Kv, kTypeKv, at, lo, hi) }

void scores(uint q_at[kQueries], uint k_at[kKeys])
{
    [[unroll]] for (uint q = 0; q < kQueries; ++q)
        [[unroll]] for (uint j = 0; j < kKeys; ++j)
            s[q][j] = 0.0;
    [[dont_unroll]] for (uint c = 0; c < p.chunks; ++c) {
        vec4 q_lo[kQueries], q_hi[kQueries];
        [[unroll]] for (uint q = 0; q < kQueries; ++q)
            load_q(q_at[q] + c * 8, q_lo[q], q_hi[q]);
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            vec4 lo, hi;
            load_kv(k_at[j] + c * 8, lo, hi);
            [[unroll]] for (uint q = 0; q < kQueries; ++q) {
                float v = s[q][j];
                v += q_lo[q].x * lo.x;
                v += q_lo[q].y * lo.y;
                v += q_lo[q].z * lo.z;
                v += q_lo[q].w * lo.w;
                v += q_hi[q].x * hi.x;
                v += q_hi[q].y * hi.y;
                v += q_hi[q].z * hi.z;
                v += q_hi[q].w * hi.w;
                s[q][j] = v;
            }
        }
    }
}

// scores become weights; what was summed before shrinks to the new largest score
void softmax_block(uint keys)
{
    [[unroll]] for (uint q = 0; q < kQueries; ++q) {
        float m = largest[q];
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            s[q][j] = j < keys ? s[q][j] * p.scale : -1e30;
            m = max(m, s[q][j]);
        }
        shrink[q] = exp2(largest[q] - m);
        float sum = total[q] * shrink[q];
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            s[q][j] = exp2(s[q][j] - m);
            sum += s[q][j];
        }
        total[q] = sum;
        largest[q] = m;
    }
}

void add_values(uint v_at[kKeys])
{
    [[dont_unroll]] for (uint c = 0; c < p.chunks; ++c) {
        vec4 lo[kQueries], hi[kQueries];
        [[unroll]] for (uint q = 0; q < kQueries; ++q) {
            lo[q] = o_lo[c][q] * shrink[q];
            hi[q] = o_hi[c][q] * shrink[q];
        }
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            vec4 v_lo, v_hi;
            load_kv(v_at[j] + c * 8, v_lo, v_hi);
            [[unroll]] for (uint q = 0; q < kQueries; ++q) {
                lo[q] += s[q][j] * v_lo;
                hi[q] += s[q][j] * v_hi;
            }
        }
        [[unroll]] for (uint q = 0; q < kQueries; ++q) {
            o_lo[c][q] = lo[q];
            o_hi[c][q] = hi[q];
        }
    }
}

void main()
{
    const uint head = gl_WorkGroupID.y * p.chunks * 8, image = gl_WorkGroupID.z;
    const uint first_query = (gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationID.x) * kQueries;
    const uint last_query = max(p.queries, p.first_row + 1) - p.first_row - 1; // rows behind it repeat it
    uint q_at[kQueries];
    [[unroll]] for (uint q = 0; q < kQueries; ++q) {
        q_at[q] = (image * p.query_rows + min(first_query + q, last_query)) * p.q_ld + p.q_col + head;
        largest[q] = -1e30;
        total[q] = 0.0;
    }
    [[dont_unroll]] for (uint i = 0; i < kQueries * p.chunks; ++i)
        o_lo[i / kQueries][i % kQueries] = o_hi[i / kQueries][i % kQueries] = vec4(0.0);
    for (uint first = 0; first < p.keys; first += kKeys) {
        uint k_at[kKeys], v_at[kKeys];
        [[unroll]] for (uint j = 0; j < kKeys; ++j) {
            const uint row_at = (image * p.key_rows + min(first + j, p.keys - 1)) * p.kv_ld + head;
            k_at[j] = row_at + p.k_col;
            v_at[j] = row_at + p.v_col;
        }
        scores(q_at, k_at);
        softmax_block(p.keys - first);
        add_values(v_at);
    }
    float inverse[kQueries]; // apart from total, so that no loop indexes that one
    [[unroll]] for (uint q = 0; q < kQueries; ++q)
        inverse[q] = 1.0 / total[q];
    [[dont_unroll]] for (uint i = 0; i < kQueries * p.chunks; ++i) {
        const uint q = i / p.chunks, c = i % p.chunks, row = first_query + q;
        if (row < p.rows)
            STORE8(y, kTypeY, (image * p.query_rows + row) * p.y_ld + head + c * 8, (o_lo[c][q] * inverse[q]),
                   (o_hi[c][q] * inverse[q]));
    }
}
