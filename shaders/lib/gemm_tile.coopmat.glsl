// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// kTileM x kTileN outputs of a workgroup of four subgroups, a quarter each, as cooperative matrices: fp16 factors, fp32
// sums. 32 columns of K at a time in shared memory, the next ones loaded into registers behind the arithmetic. The
// planner sets tile, shape and threads; every tile gives the same bits, as K is summed in one order.
#include "lib/cooperative_matrix.glsl"

const uint kStep = 32;         // columns of K in shared memory
const uint kPitch = kStep + 8; // fp16 of a row: 16 bytes more, so that rows begin in different banks
const uint kHalfM = kTileM / 2, kHalfN = kTileN / 2;
const uint kMatsDown = kHalfM / kMatM, kMatsAcross = kHalfN / kMatN;
const uint kLoadsX = kTileM * kStep / 8 / kThreads, kLoadsW = kTileN * kStep / 8 / kThreads;
const uint kSlab = 16, kSlabPitch = 20; // rows and columns that a subgroup finishes at once, and floats of a row

shared uvec4 tile_x[kTileM * kPitch / 8];  // [row][k], eight fp16 each
shared uvec4 tile_w[kTileN * kPitch / 8];  // [col][k]
shared float slab[4 * kSlab * kSlabPitch]; // of each subgroup

#define MatrixX coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixW coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixY coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixY sums[kMatsDown * kMatsAcross];
uvec4 next_x[kLoadsX], next_w[kLoadsW]; // of the next step: eight columns of a row each

// which row of the tile, and which columns of the step, load i of this thread brings
uint load_row(uint i) { return (i * kThreads + gl_LocalInvocationID.x) / 4; }
uint load_k() { return gl_LocalInvocationID.x % 4 * 8; } // kThreads is a multiple of 4

void clear_tile()
{
    [[unroll]] for (uint i = 0; i < kMatsDown * kMatsAcross; ++i)
        sums[i] = MatrixY(0.0);
}

void stage()
{
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i)
        tile_x[(load_row(i) * kPitch + load_k()) / 8] = next_x[i];
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i)
        tile_w[(load_row(i) * kPitch + load_k()) / 8] = next_w[i];
}

// first row and column of this subgroup's quarter
uint quarter_row() { return gl_SubgroupID % 2 * kHalfM; }
uint quarter_col() { return gl_SubgroupID / 2 * kHalfN; }

void multiply()
{
    [[unroll]] for (uint k = 0; k < kStep; k += kMatK) {
        MatrixX a[kMatsDown];
        [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
            coopMatLoad(a[i], tile_x, ((quarter_row() + i * kMatM) * kPitch + k) / 8, kPitch / 8,
                        gl_CooperativeMatrixLayoutRowMajor);
        [[unroll]] for (uint j = 0; j < kMatsAcross; ++j) {
            MatrixW b;
            coopMatLoad(b, tile_w, ((quarter_col() + j * kMatN) * kPitch + k) / 8, kPitch / 8,
                        gl_CooperativeMatrixLayoutColumnMajor);
            [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
                sums[i * kMatsAcross + j] = coopMatMulAdd(a[i], b, sums[i * kMatsAcross + j]);
        }
    }
}

void write_slab(uint at, vec4 lo, vec4 hi)
{
    [[unroll]] for (uint i = 0; i < 4; ++i) {
        slab[at + i] = lo[i];
        slab[at + 4 + i] = hi[i];
    }
}

// eight columns of a row of the slab; with GEGLU the eight after them are their gates
void finish_slab_row(uint slab_at, uint item, uint first_row, uint first_col)
{
    const uint row = first_row + item / 2, col = first_col + item % 2 * 8;
    const uint at = slab_at + item / 2 * kSlabPitch + item % 2 * 8;
    if (row >= p.rows || col >= p.cols || (kGeglu && item % 2 != 0))
        return;
    vec4 lo, hi;
    READ8(slab, at, lo, hi);
    activate8(row, col, lo, hi);
    if (kGeglu) {
        vec4 gate_lo, gate_hi;
        READ8(slab, at + 8, gate_lo, gate_hi);
        activate8(row, col + 8, gate_lo, gate_hi);
        lo *= gelu_erf(gate_lo);
        hi *= gelu_erf(gate_hi);
    }
    finish8(row, kGeglu ? col / 2 : col, kGeglu ? p.cols / 2 : p.cols, lo, hi);
    if (kMoments)
        write_slab(at, lo, hi);
}

// of 16 rows of eight columns
void store_slab_moments(uint slab_at, uint half_of, uint first_row, uint first_col)
{
    const uint col = first_col + half_of * 8;
    if (first_row >= p.rows || col >= p.cols)
        return;
    ColumnMoments m = no_moments();
    for (uint i = 0; i < kSlab; ++i) {
        vec4 lo, hi;
        READ8(slab, slab_at + i * kSlabPitch + half_of * 8, lo, hi);
        if (counts_in_moments(first_row + i))
            add_moments(m, lo, hi);
    }
    store_moments(first_row, col, m);
}

// Through the slab, as the extension does not say which lane holds which sum. note: compilers must know which sums are
// stored, or all of them lie in memory; unrolled for each slab the epilogue would be many times as long.
void store_tile(uint tile_row, uint tile_col)
{
    const uint at = gl_SubgroupID * kSlab * kSlabPitch, across = kHalfN / kSlab;
    [[dont_unroll]] for (uint s = 0; s < kHalfM / kSlab * across; ++s) {
        own_barrier();
        [[unroll]] for (uint i = 0; i < kMatsDown * kMatsAcross; ++i) {
            const uint r = i / kMatsAcross * kMatM, c = i % kMatsAcross * kMatN;
            if (r / kSlab * across + c / kSlab == s)
                coopMatStore(sums[i], slab, at + r % kSlab * kSlabPitch + c % kSlab, kSlabPitch,
                             gl_CooperativeMatrixLayoutRowMajor);
        }
        own_barrier();
        const uint row = tile_row + quarter_row() + s / across * kSlab;
        const uint col = tile_col + quarter_col() + s % across * kSlab;
        for (uint item = gl_SubgroupInvocationID; item < 2 * kSlab; item += gl_SubgroupSize)
            finish_slab_row(at, item, row, col);
        if (kMoments) {
            own_barrier();
            if (gl_SubgroupInvocationID < 2)
                store_slab_moments(at, gl_SubgroupInvocationID, row, col);
        }
    }
}
