#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v of fp16 inputs, online over blocks of 32 keys, for GPUs with matrix units: a workgroup of
// four subgroups holds 64 queries of one head, 16 a subgroup. Keys, then values, of a block go through the same shared
// memory; queries and sums stay in registers, which is why head_dim is 96 at most. tools/spirv compiles it.
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
layout(constant_id = 30) const uint kMatM = 16; // 8 or 16
layout(constant_id = 31) const uint kMatN = 16; // 8 or 16
layout(constant_id = 32) const uint kMatK = 16; // divides 32
layout(constant_id = 33) const uint kThreads = 128;
layout(push_constant) uniform Push { FlashAttentionPush p; };
layout(binding = 0) readonly buffer Q { uvec4 q[]; };    // [batch * query_rows, q_ld], fp16
layout(binding = 1) readonly buffer Kv { uvec4 kv[]; };  // [batch * key_rows, kv_ld], fp16
layout(binding = 2) writeonly buffer Y { uvec4 y[]; };   // [batch * query_rows, y_ld]

const uint kKeys = 32;    // of a block
const uint kQueries = 16; // of a subgroup
const uint kParts = (kChunks + 3) / 4;              // head_dim in steps of 32, with zeros behind it
const uint kDim = kParts * 32, kPitch = kDim / 8 + 1; // uvec4 of a row: rows begin in different banks
const uint kDown = kQueries / kMatM, kKeysAcross = kKeys / kMatN, kDimAcross = kDim / kMatN, kDimSteps = kDim / kMatK;
const uint kScorePitch = kKeys + 4;       // floats
const uint kWeightPitch = kKeys / 8 + 1;  // uvec4 of eight fp16
const uint kValuePitch = kKeys / 8 + 1;   // likewise: values lie channel by channel, as matrix units want them

shared uvec4 rows_of[kDim * kValuePitch];          // 32 queries or keys, or the values of 32 keys
shared float scores[4 * kQueries * kScorePitch];   // of each subgroup; then other matrices of 16 rows
shared uvec4 weights[4 * kQueries * kWeightPitch]; // likewise, fp16

#define MatrixQ coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixKv coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixS coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixQ queries[kDown * kDimSteps];
MatrixS sums[kDown * kDimAcross];
uint score_at, weight_at; // of this subgroup

// what a subgroup wrote to its parts of shared memory, the others do not see
void own_barrier()
{
    subgroupMemoryBarrierShared();
    subgroupBarrier();
}

// 32 rows of q, clamped to the image's
void stage_queries(uint image, uint first, uint last, uint column)
{
    barrier();
    for (uint i = gl_LocalInvocationID.x; i < kKeys * kParts * 4; i += kThreads) {
        const uint row = min(first + i / (kParts * 4), last), c = i % (kParts * 4);
        rows_of[i / (kParts * 4) * kPitch + c] =
            c < kChunks ? q[((image * p.query_rows + row) * p.q_ld + column) / 8 + c] : uvec4(0);
    }
    barrier();
}

// eight channels of a key or a value (`column`); zeros behind the last
uvec4 load_kv(uint image, uint key, uint column, uint c)
{
    return c < kChunks && key < p.keys ? kv[((image * p.key_rows + key) * p.kv_ld + column) / 8 + c] : uvec4(0);
}

void stage_keys(uint image, uint first, uint column)
{
    barrier(); // the values may still be read
    for (uint i = gl_LocalInvocationID.x; i < kKeys * kParts * 4; i += kThreads) {
        const uint key = i / (kParts * 4), c = i % (kParts * 4);
        rows_of[key * kPitch + c] = load_kv(image, first + key, column, c);
    }
    barrier();
}

// two keys' values at a time, as they share a word
void stage_values(uint image, uint first, uint column)
{
    barrier(); // the keys may still be read
    for (uint i = gl_LocalInvocationID.x; i < kKeys / 2 * kParts * 4; i += kThreads) {
        const uint key = i % (kKeys / 2) * 2, c = i / (kKeys / 2);
        const uvec4 a = load_kv(image, first + key, column, c), b = load_kv(image, first + key + 1, column, c);
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            rows_of[(c * 8 + 2 * j) * kValuePitch + key / 8][key / 2 % 4] = (a[j] & 0xffff) | b[j] << 16;
            rows_of[(c * 8 + 2 * j + 1) * kValuePitch + key / 8][key / 2 % 4] = a[j] >> 16 | (b[j] & 0xffff0000);
        }
    }
    barrier();
}

void load_queries(uint image, uint first, uint column)
{
    const uint last = max(p.queries, p.first_row + 1) - p.first_row - 1; // rows behind it repeat it
    [[unroll]] for (uint turn = 0; turn < 2; ++turn) {
        stage_queries(image, first + turn * kKeys, last, column);
        if (gl_SubgroupID / 2 == turn)
            [[unroll]] for (uint i = 0; i < kDown; ++i)
                [[unroll]] for (uint k = 0; k < kDimSteps; ++k)
                    coopMatLoad(queries[i * kDimSteps + k], rows_of,
                                (gl_SubgroupID % 2 * kQueries + i * kMatM) * kPitch + k * kMatK / 8, kPitch,
                                gl_CooperativeMatrixLayoutRowMajor);
    }
}

// of this subgroup's queries with the keys that are staged, to `scores`
void multiply_keys()
{
    [[unroll]] for (uint j = 0; j < kKeysAcross; ++j) {
        MatrixS s[kDown];
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            s[i] = MatrixS(0.0);
        [[unroll]] for (uint k = 0; k < kDimSteps; ++k) {
            MatrixKv b;
            coopMatLoad(b, rows_of, j * kMatN * kPitch + k * kMatK / 8, kPitch, gl_CooperativeMatrixLayoutColumnMajor);
            [[unroll]] for (uint i = 0; i < kDown; ++i)
                s[i] = coopMatMulAdd(queries[i * kDimSteps + k], b, s[i]);
        }
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            coopMatStore(s[i], scores, score_at + i * kMatM * kScorePitch + j * kMatN, kScorePitch,
                         gl_CooperativeMatrixLayoutRowMajor);
    }
}

// a row is two invocations' side by side: each has half of the keys, and both have its largest score and total
const uint kRounds = 8 * kQueries / kThreads > 0 ? 8 * kQueries / kThreads : 1;
uint row_of(uint round) { return (round * gl_SubgroupSize + gl_SubgroupInvocationID) / 2; }

// scores of a block to weights, and to the factor of what was summed before
void softmax_block(uint first, inout float largest[kRounds], inout float total[kRounds])
{
    const uint part = gl_SubgroupInvocationID % 2 * (kKeys / 2);
    own_barrier();
    [[unroll]] for (uint round = 0; round < kRounds; ++round) {
        const bool inside = row_of(round) < kQueries;
        const uint row = min(row_of(round), kQueries - 1), at = score_at + row * kScorePitch + part;
        float s[kKeys / 2], m = largest[round];
        [[unroll]] for (uint j = 0; j < kKeys / 2; ++j) {
            s[j] = first + part + j < p.keys ? scores[at + j] * p.scale : -1e30;
            m = max(m, s[j]);
        }
        m = max(m, subgroupShuffleXor(m, 1));
        const float shrink = exp2(largest[round] - m);
        largest[round] = m;
        float sum = 0.0;
        [[unroll]] for (uint j = 0; j < kKeys / 2; ++j) {
            s[j] = exp2(s[j] - m);
            sum += s[j];
        }
        total[round] = total[round] * shrink + sum + subgroupShuffleXor(sum, 1);
        own_barrier(); // both halves of a row are read
        if (!inside)
            continue;
        [[unroll]] for (uint j = 0; j < kKeys / 2; j += 8)
            weights[weight_at + row * kWeightPitch + (part + j) / 8] =
                pack8(vec4(s[j], s[j + 1], s[j + 2], s[j + 3]), vec4(s[j + 4], s[j + 5], s[j + 6], s[j + 7]));
        [[unroll]] for (uint j = 0; j < kMatN / 2; ++j)
            scores[score_at + row * kScorePitch + part / (kKeys / 2) * (kMatN / 2) + j] = shrink;
    }
    own_barrier();
}

void shrink_sums()
{
    [[unroll]] for (uint i = 0; i < kDown; ++i) {
        MatrixS shrink;
        coopMatLoad(shrink, scores, score_at + i * kMatM * kScorePitch, kScorePitch,
                    gl_CooperativeMatrixLayoutRowMajor);
        [[unroll]] for (uint j = 0; j < kDimAcross; ++j)
            sums[i * kDimAcross + j] = sums[i * kDimAcross + j] * shrink;
    }
}

// weights times the values that are staged
void add_values()
{
    MatrixQ w[kDown * (kKeys / kMatK)];
    [[unroll]] for (uint i = 0; i < kDown; ++i)
        [[unroll]] for (uint k = 0; k < kKeys / kMatK; ++k)
            coopMatLoad(w[i * (kKeys / kMatK) + k], weights, weight_at + i * kMatM * kWeightPitch + k * kMatK / 8,
                        kWeightPitch, gl_CooperativeMatrixLayoutRowMajor);
    [[unroll]] for (uint j = 0; j < kDimAcross; ++j)
        [[unroll]] for (uint k = 0; k < kKeys / kMatK; ++k) {
            MatrixKv b;
            coopMatLoad(b, rows_of, j * kMatN * kValuePitch + k * kMatK / 8, kValuePitch,
                        gl_CooperativeMatrixLayoutColumnMajor);
            [[unroll]] for (uint i = 0; i < kDown; ++i)
                sums[i * kDimAcross + j] =
                    coopMatMulAdd(w[i * (kKeys / kMatK) + k], b, sums[i * kDimAcross + j]);
        }
}

// 16 channels of this subgroup's queries at a time, through `scores`; y_at: of the image's first row in y
void store(uint first_query, uint y_at, uint head, float total[kRounds])
{
    [[dont_unroll]] for (uint piece = 0; piece < kDim / 16; ++piece) {
        own_barrier();
        [[unroll]] for (uint i = 0; i < kDown * kDimAcross; ++i) {
            const uint column = i % kDimAcross * kMatN;
            if (column / 16 == piece)
                coopMatStore(sums[i], scores, score_at + i / kDimAcross * kMatM * kScorePitch + column % 16,
                             kScorePitch, gl_CooperativeMatrixLayoutRowMajor);
        }
        own_barrier();
        [[unroll]] for (uint round = 0; round < kRounds; ++round) {
            const uint own = row_of(round), half_of = gl_SubgroupInvocationID % 2;
            const uint row = first_query + gl_SubgroupID * kQueries + own, c = piece * 2 + half_of;
            if (own >= kQueries || row >= p.rows || c >= kChunks)
                continue;
            const uint at = score_at + own * kScorePitch + half_of * 8;
            const float inverse = 1.0 / total[round];
            const vec4 lo = vec4(scores[at], scores[at + 1], scores[at + 2], scores[at + 3]) * inverse;
            const vec4 hi = vec4(scores[at + 4], scores[at + 5], scores[at + 6], scores[at + 7]) * inverse;
            STORE8(y, kHalfY, y_at + row * p.y_ld + head + c * 8, lo, hi);
        }
    }
}

void main()
{
    const uint first_query = gl_WorkGroupID.x * kTileM, head = gl_WorkGroupID.y * kChunks * 8, image = gl_WorkGroupID.z;
    score_at = gl_SubgroupID * kQueries * kScorePitch;
    weight_at = gl_SubgroupID * kQueries * kWeightPitch;
    load_queries(image, first_query, p.q_col + head);
    [[unroll]] for (uint i = 0; i < kDown * kDimAcross; ++i)
        sums[i] = MatrixS(0.0);
    float largest[kRounds], total[kRounds];
    [[unroll]] for (uint round = 0; round < kRounds; ++round) {
        largest[round] = -1e30;
        total[round] = 0.0;
    }
    for (uint first = 0; first < p.keys; first += kKeys) {
        stage_keys(image, first, p.k_col + head);
        multiply_keys();
        softmax_block(first, largest, total);
        stage_values(image, first, p.v_col + head);
        shrink_sums();
        add_values();
    }
    store(first_query, image * p.query_rows * p.y_ld, head, total);
}
