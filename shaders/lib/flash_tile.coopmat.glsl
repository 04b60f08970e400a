// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// Attention by cooperative matrices, online over blocks of 32 keys: 16 queries a subgroup, whose queries and sums stay
// in registers. Includers say kChunks (head_dim / 8), kSides (how many blocks of keys are staged at once) and
// visible_keys(row, first), a bit for each of the 32 keys from `first` on; they set block_at and score_scale.
#include "lib/cooperative_matrix.glsl"

const uint kKeys = 32;    // of a block
const uint kQueries = 16; // of a subgroup
const uint kRowChunks = (kChunks + 3) / 4 * 4; // head_dim in steps of 32, with zeros behind it
const uint kDim = kRowChunks * 8;
const uint kPitch = kRowChunks + 1;      // uvec4 of a row of queries or keys: rows begin in different banks
const uint kScorePitch = kKeys / 4 + 1;  // uvec4 of a row of scores
const uint kWeightPitch = kKeys / 8 + 1; // uvec4
const uint kDown = kQueries / kMatM, kKeysAcross = kKeys / kMatN, kDimAcross = kDim / kMatN, kDimSteps = kDim / kMatK;
const uint kBlock = kKeys * kPitch; // uvec4 of what is staged of a side

shared uvec4 rows_of[kSides * kBlock];             // 32 queries or keys, or the values of 32 keys
shared uvec4 scores[4 * kQueries * kScorePitch];   // of each subgroup, floats; then other matrices of 16 rows
shared uvec4 weights[4 * kQueries * kWeightPitch]; // likewise, fp16

#define MatrixQ coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixKv coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixS coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixQ queries[kDown * kDimSteps];
MatrixS sums[kDown * kDimAcross];
uint score_at, weight_at; // of this subgroup
uint block_at;            // of the side whose keys it looks at
float score_scale;        // log2(e) times that of the scores
bool shrinks;             // did the largest score of any row of this subgroup move?

// a row is two invocations' side by side: each has half of the keys, and both have its largest score and total
const uint kRounds = 8 * kQueries / kThreads > 0 ? 8 * kQueries / kThreads : 1;
uint row_of(uint round) { return (round * gl_SubgroupSize + gl_SubgroupInvocationID) / 2; }
float largest[kRounds], total[kRounds];

void start_attention()
{
    score_at = gl_SubgroupID * kQueries * kScorePitch;
    weight_at = gl_SubgroupID * kQueries * kWeightPitch;
    [[unroll]] for (uint i = 0; i < kDown * kDimAcross; ++i)
        sums[i] = MatrixS(0.0);
    [[unroll]] for (uint round = 0; round < kRounds; ++round) {
        largest[round] = -1e30;
        total[round] = 0.0;
    }
}

// eight channels of a query, a key or a value
void stage_row(uint block, uint row, uint chunk, uvec4 value) { rows_of[block + row * kPitch + chunk] = value; }

// from the rows that are staged, `first` on
void load_queries(uint first)
{
    [[unroll]] for (uint i = 0; i < kDown; ++i)
        [[unroll]] for (uint k = 0; k < kDimSteps; ++k)
            coopMatLoad(queries[i * kDimSteps + k], rows_of, (first + i * kMatM) * kPitch + k * kMatK / 8, kPitch,
                        gl_CooperativeMatrixLayoutRowMajor);
}

// with the keys that are staged, to `scores`
void multiply_keys()
{
    [[unroll]] for (uint j = 0; j < kKeysAcross; ++j) {
        MatrixS s[kDown];
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            s[i] = MatrixS(0.0);
        [[unroll]] for (uint k = 0; k < kDimSteps; ++k) {
            MatrixKv b;
            coopMatLoad(b, rows_of, block_at + j * kMatN * kPitch + k * kMatK / 8, kPitch,
                        gl_CooperativeMatrixLayoutColumnMajor);
            [[unroll]] for (uint i = 0; i < kDown; ++i)
                s[i] = coopMatMulAdd(queries[i * kDimSteps + k], b, s[i]);
        }
        [[unroll]] for (uint i = 0; i < kDown; ++i)
            coopMatStore(s[i], scores, score_at + i * kMatM * kScorePitch + j * kMatN / 4, kScorePitch,
                         gl_CooperativeMatrixLayoutRowMajor);
    }
}

// scores of a block, of which `first` is the first key, to weights and to the factor of what was summed before
void softmax_block(uint first)
{
    const uint part = gl_SubgroupInvocationID % 2 * (kKeys / 2);
    bool moved = false;
    own_barrier();
    [[unroll]] for (uint round = 0; round < kRounds; ++round) {
        const bool inside = row_of(round) < kQueries;
        const uint row = min(row_of(round), kQueries - 1), at = score_at + row * kScorePitch + part / 4;
        const uint visible = visible_keys(row, first) >> part;
        float s[kKeys / 2], m = largest[round];
        [[unroll]] for (uint j = 0; j < kKeys / 2; j += 4) {
            const vec4 four = uintBitsToFloat(scores[at + j / 4]) * score_scale;
            [[unroll]] for (uint i = 0; i < 4; ++i) {
                s[j + i] = (visible >> (j + i) & 1) != 0 ? four[i] : -1e30;
                m = max(m, s[j + i]);
            }
        }
        m = max(m, subgroupShuffleXor(m, 1));
        moved = moved || m != largest[round];
        const float shrink = exp2(largest[round] - m);
        largest[round] = m;
        float sum = 0.0; // of what is added: rounded
        uint halves[kKeys / 4];
        [[unroll]] for (uint j = 0; j < kKeys / 2; j += 2) {
            vec2 two = vec2((visible >> j & 1) != 0 ? exp2(s[j] - m) : 0.0,
                                  (visible >> (j + 1) & 1) != 0 ? exp2(s[j + 1] - m) : 0.0);
            halves[j / 2] = pack_shares(two);
            sum += two.x + two.y;
        }
        total[round] = total[round] * shrink + sum + subgroupShuffleXor(sum, 1);
        own_barrier(); // both halves of a row are read
        if (!inside)
            continue;
        [[unroll]] for (uint j = 0; j < kKeys / 2; j += 8)
            weights[weight_at + row * kWeightPitch + (part + j) / 8] =
                uvec4(halves[j / 2], halves[j / 2 + 1], halves[j / 2 + 2], halves[j / 2 + 3]);
        [[unroll]] for (uint j = 0; j < kMatN / 8; ++j) // a matrix that has it in each column
            scores[score_at + row * kScorePitch + part / (kKeys / 2) * (kMatN / 8) + j] = floatBitsToUint(vec4(shrink));
    }
    shrinks = subgroupAny(moved);
    own_barrier();
}

void shrink_sums()
{
    if (!shrinks) // all factors are 1
        return;
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
            coopMatLoad(b, rows_of, block_at + k * kMatK * kPitch + j * kMatN / 8, kPitch,
                        gl_CooperativeMatrixLayoutRowMajor);
            [[unroll]] for (uint i = 0; i < kDown; ++i)
                sums[i * kDimAcross + j] = coopMatMulAdd(w[i * (kKeys / kMatK) + k], b, sums[i * kDimAcross + j]);
        }
}

// 16 channels of the sums, from 16 piece on, to `scores`. note: compilers must know which sums are stored, or all of
// them lie in memory
void put_sums(uint piece)
{
    [[unroll]] for (uint i = 0; i < kDown * kDimAcross; ++i) {
        const uint column = i % kDimAcross * kMatN;
        if (column / 16 == piece)
            coopMatStore(sums[i], scores, score_at + i / kDimAcross * kMatM * kScorePitch + column % 16 / 4,
                         kScorePitch, gl_CooperativeMatrixLayoutRowMajor);
    }
}
