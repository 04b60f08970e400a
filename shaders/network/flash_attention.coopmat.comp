#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = softmax(q k^T scale) v of fp16 inputs, for GPUs with matrix units: a workgroup of four subgroups has 128 queries
// of one head, 32 a subgroup (heads of more than 40: 16 in each of two turns). Queries and sums stay in registers.
// tools/dev/spirv compiles it.
//
// Scores become weights in registers, although the extension does not say which element lies where: what is subtracted
// from a row's scores is a matrix that has the same number in all of its columns. It need not be the row's largest
// score. It is raised only when a score exceeds it by more than kMost; up to there 2^score fits in fp16. The rows'
// totals are sums, too: values have one more channel, which is 1.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#include "flash_attention.h"
#include "lib/pack.glsl"

layout(local_size_x = 128, local_size_x_id = 33) in; // kThreads
layout(constant_id = 2) const uint kTypeY = kF16;
layout(constant_id = 3) const uint kChunks = 10; // head_dim / 8
layout(constant_id = 4) const uint kTileM = 128;
layout(constant_id = 5) const uint kTileN = 1;
layout(push_constant) uniform Push { FlashAttentionPush p; };
layout(binding = 0) readonly buffer Q { uvec4 q[]; };   // [batch * query_rows, q_ld], fp16
layout(binding = 1) readonly buffer Kv { uvec4 kv[]; }; // [batch * key_rows, kv_ld], fp16
layout(binding = 2) writeonly buffer Y { uvec4 y[]; };  // [batch * query_rows, y_ld]
#include "lib/cooperative_matrix.glsl"

const float kMost = 10.0;
// where sizes of shared memory hang on it there is no ?: and no |, as cmake/reflect does sums, products and quotients
const uint kWide = kChunks / 6;
const uint kQueries = 16 + 16 / (kWide * 16 + 1);            // of a subgroup: 32, or 16 for more than 5 chunks
const uint kKeys = 32 + 32 / (kWide * 32 + 1);               // of a block: 64, or 32
const uint kDim = (kChunks * 8 + kMatK - 1) / kMatK * kMatK; // of queries and keys, with zeros behind the head's
const uint kSumDim = (kChunks * 8 + kMatN) / kMatN * kMatN;  // of values and sums: with the total's channel
const uint kKeyPitch = kDim / 16 * 2 + 1;                    // uvec4, odd: rows begin in different banks
const uint kValuePitch = kSumDim / 16 * 2 + 1;
const uint kWeightPitch = kKeys / 8 + 1;
const uint kDown = kQueries / kMatM, kKeysAcross = kKeys / kMatN, kAcross = kSumDim / kMatN, kSteps = kDim / kMatK;
const uint kValuesAt = kKeys * kKeyPitch;
const uint kTotalAt = kChunks * 8 / kMatN; // which matrix across has the total
const uint kLoads = (kKeys * kChunks + kThreads - 1) / kThreads;
const uint kLanes = kThreads / 4; // of a subgroup
const uint kOwnRows = kQueries > kLanes ? kQueries / kLanes : 1;

shared uvec4 tile[kKeys * (kKeyPitch + kValuePitch + kMatK / 32 * 4)]; // queries at first; then keys, values
shared uvec4 weights[4 * kQueries * kWeightPitch]; // of each subgroup, fp16; then other matrices

#define MatrixQ coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixKv coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixS coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>
#define MatrixW coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixQ queries[kDown * kSteps];
MatrixS sums[kDown * kAcross], subtracted[kDown];
uvec4 next_keys[kLoads], next_values[kLoads]; // of the next block
uint own_at;                                  // this subgroup's weights

// row r of those of this subgroup that this invocation looks after; beyond the last there may be none
uint own_row(uint r) { return r * kLanes + gl_SubgroupInvocationID; }

#include "lib/flash_stage.coopmat.glsl"

// scores of the staged keys from kMatN j on, less what is subtracted
void multiply_keys(uint j, out MatrixS s[kDown])
{
    [[unroll]] for (uint i = 0; i < kDown; ++i)
        s[i] = MatrixS(0.0);
    [[unroll]] for (uint k = 0; k < kSteps; ++k) {
        MatrixKv b;
        coopMatLoad(b, tile, j * kMatN * kKeyPitch + k * kMatK / 8, kKeyPitch, gl_CooperativeMatrixLayoutColumnMajor);
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            s[i] = coopMatMulAdd(queries[i * kSteps + k], b, s[i]);
    }
    [[unroll]] for (uint i = 0; i < kDown; ++i)
        [[unroll]] for (uint e = 0; e < s[i].length(); ++e)
            s[i][e] = fma(s[i][e], p.scale, -subtracted[i][e]);
}

// Raises what is subtracted from a row's scores to the largest of this block, if that exceeds it by kMost. A row's bits
// depend on no other row. note: not all subgroups come here, and lavapipe takes a subgroup's barrier for one of the
// workgroup. But a subgroup's invocations meet at each load and store of a matrix.
void raise_subtracted(bool first_block)
{
    float most[kOwnRows];
    [[unroll]] for (uint r = 0; r < kOwnRows; ++r)
        most[r] = -1e30;
    [[dont_unroll]] for (uint j = 0; j < kKeysAcross; ++j) {
        MatrixS s[kDown];
        multiply_keys(j, s);
        subgroupMemoryBarrierShared();
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            coopMatStore(s[i], weights, own_at + i * kMatM * kWeightPitch, kWeightPitch,
                         gl_CooperativeMatrixLayoutRowMajor);
        subgroupMemoryBarrierShared();
        [[unroll]] for (uint r = 0; r < kOwnRows; ++r)
            if (own_row(r) < kQueries)
                [[unroll]] for (uint c = 0; c < kMatN / 4; ++c) {
                    const vec4 four = uintBitsToFloat(weights[own_at + own_row(r) * kWeightPitch + c]);
                    most[r] = max(most[r], max(max(four.x, four.y), max(four.z, four.w)));
                }
    }
    subgroupMemoryBarrierShared();
    [[unroll]] for (uint r = 0; r < kOwnRows; ++r)
        if (own_row(r) < kQueries)
            [[unroll]] for (uint c = 0; c < kMatN / 4; ++c)
                weights[own_at + own_row(r) * kWeightPitch + c] =
                    floatBitsToUint(vec4(first_block || most[r] > kMost ? most[r] : 0.0));
    subgroupMemoryBarrierShared();
    [[unroll]] for (uint i = 0; i < kDown; ++i) {
        MatrixS by;
        coopMatLoad(by, weights, own_at + i * kMatM * kWeightPitch, kWeightPitch, gl_CooperativeMatrixLayoutRowMajor);
        subtracted[i] = subtracted[i] + by;
        [[unroll]] for (uint e = 0; e < by.length(); ++e)
            by[e] = by[e] > 0.0 ? exp2(-by[e]) : 1.0; // in the first block sums are zero
        [[unroll]] for (uint j = 0; j < kAcross; ++j)
            sums[i * kAcross + j] = sums[i * kAcross + j] * by;
    }
    subgroupMemoryBarrierShared();
}

// -> the largest exponent of this invocation's elements
float weigh_keys()
{
    float most = -1e30;
    [[dont_unroll]] for (uint j = 0; j < kKeysAcross; ++j) {
        MatrixS s[kDown];
        multiply_keys(j, s);
        [[unroll]] for (uint i = 0; i < kDown; ++i) {
            [[unroll]] for (uint e = 0; e < s[i].length(); ++e) {
                most = max(most, s[i][e]);
                s[i][e] = exp2(s[i][e]);
            }
            coopMatStore(MatrixW(s[i]), weights, own_at + i * kMatM * kWeightPitch + j * kMatN / 8, kWeightPitch,
                         gl_CooperativeMatrixLayoutRowMajor);
        }
    }
    return most;
}

// weights times the values that are staged
void add_values()
{
    [[dont_unroll]] for (uint k = 0; k < kKeys / kMatK; ++k) {
        MatrixQ w[kDown];
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            coopMatLoad(w[i], weights, own_at + i * kMatM * kWeightPitch + k * kMatK / 8, kWeightPitch,
                        gl_CooperativeMatrixLayoutRowMajor);
        [[unroll]] for (uint j = 0; j < kAcross; ++j) {
            MatrixKv b;
            coopMatLoad(b, tile, kValuesAt + k * kMatK * kValuePitch + j * kMatN / 8, kValuePitch,
                        gl_CooperativeMatrixLayoutRowMajor);
            [[unroll]] for (uint i = 0; i < kDown; ++i)
                sums[i * kAcross + j] = coopMatMulAdd(w[i], b, sums[i * kAcross + j]);
        }
    }
}

void attend_block(uint first)
{
    if (first == 0 || subgroupAny(weigh_keys() > kMost)) {
        raise_subtracted(first == 0);
        weigh_keys(); // no exponent is above zero
    }
    own_barrier();
    add_values();
}

#include "lib/flash_store.coopmat.glsl"

void attend(uint first_query, uint head, uint image)
{
    load_queries(image, first_query, p.q_col + head);
    [[unroll]] for (uint i = 0; i < kDown * kAcross; ++i)
        sums[i] = MatrixS(0.0);
    [[unroll]] for (uint i = 0; i < kDown; ++i)
        subtracted[i] = MatrixS(0.0);
    load_block(image, 0, head);
    for (uint first = 0; first < p.keys; first += kKeys) {
        barrier(); // the last block, or queries, may still be read
        stage_block(first);
        barrier();
        load_block(image, first + kKeys, head); // after the last one for nothing
        attend_block(first);
    }
    store(first_query, image * p.query_rows * p.y_ld + head);
}

void main()
{
    const uint head = gl_WorkGroupID.y * kChunks * 8;
    own_at = gl_SubgroupID * kQueries * kWeightPitch;
    [[dont_unroll]] for (uint turn = 0; turn < kTileM; turn += 4 * kQueries) {
        const uint first_query = gl_WorkGroupID.x * kTileM + turn;
        if (first_query < p.rows)
            attend(first_query, head, gl_WorkGroupID.z);
    }
}
