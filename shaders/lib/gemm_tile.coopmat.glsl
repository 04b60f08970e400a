// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// kTileM x kTileN outputs of a workgroup as cooperative matrices, fp16 factors and fp32 sums; its subgroups, two of them
// down, own a part each. kStep columns of K at a time in shared memory, the next ones loaded into registers behind the
// arithmetic. The planner sets all of these; all give the same bits, as K is summed in one order.
#include "lib/cooperative_matrix.glsl"

layout(constant_id = 34) const uint kStep = 32;     // a multiple of 32
layout(constant_id = 35) const uint kSubgroups = 4; // or 8
const uint kPitch = kStep + 8; // fp16 of a row: 16 bytes more, so that rows begin in different banks
const uint kPartM = kTileM / 2, kPartN = kTileN / (kSubgroups / 2);
const uint kMatsDown = kPartM / kMatM, kMatsAcross = kPartN / kMatN;
const uint kLoadsX = kTileM * kStep / 8 / kThreads, kLoadsW = kTileN * kStep / 8 / kThreads;
const uint kSlab = 16, kSlabPitch = 5; // rows and columns that a subgroup finishes at once, and vec4 of a row

shared uvec4 tile_x[kTileM * kPitch / 8];  // [row][k], eight fp16 each
shared uvec4 tile_w[kTileN * kPitch / 8];  // [col][k]
shared vec4 slab[kSubgroups * kSlab * kSlabPitch]; // of each subgroup

#define MatrixX coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixW coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixY coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixY sums[kMatsDown * kMatsAcross];
uvec4 next_x[kLoadsX], next_w[kLoadsW]; // of the next step: eight columns of a row each

// which row of the tile, and which columns of the step, load i of this thread brings
uint load_row(uint i) { return (i * kThreads + gl_LocalInvocationID.x) / (kStep / 8); }
uint load_k() { return gl_LocalInvocationID.x % (kStep / 8) * 8; } // kThreads is a multiple of kStep / 8

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

// first row and column of this subgroup's part
uint part_row() { return gl_SubgroupID % 2 * kPartM; }
uint part_col() { return gl_SubgroupID / 2 * kPartN; }

void multiply()
{
    [[unroll]] for (uint k = 0; k < kStep; k += kMatK) {
        MatrixX a[kMatsDown];
        [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
            coopMatLoad(a[i], tile_x, ((part_row() + i * kMatM) * kPitch + k) / 8, kPitch / 8,
                        gl_CooperativeMatrixLayoutRowMajor);
        [[unroll]] for (uint j = 0; j < kMatsAcross; ++j) {
            MatrixW b;
            coopMatLoad(b, tile_w, ((part_col() + j * kMatN) * kPitch + k) / 8, kPitch / 8,
                        gl_CooperativeMatrixLayoutColumnMajor);
            [[unroll]] for (uint i = 0; i < kMatsDown; ++i)
                sums[i * kMatsAcross + j] = coopMatMulAdd(a[i], b, sums[i * kMatsAcross + j]);
        }
    }
}

// eight columns of a row of the slab; with GEGLU the eight after them are their gates
void finish_slab_row(uint slab_at, uint item, uint first_row, uint first_col)
{
    const uint row = first_row + item / 2, col = first_col + item % 2 * 8;
    const uint at = slab_at + item / 2 * kSlabPitch + item % 2 * 2;
    vec4 lo = slab[at], hi = slab[at + 1];
    if (row >= p.rows || col >= p.cols || (kGeglu && item % 2 != 0))
        return;
    if (kSlices > 1) { // beside each other in a row: split_k_reduce adds them
        STORE8(y, kF32, row * p.y_ld + gl_WorkGroupID.z * (p.y_ld / kSlices) + col, lo, hi);
        return;
    }
    activate8(row, col, lo, hi);
    if (kGeglu) {
        vec4 gate_lo = slab[at + 2], gate_hi = slab[at + 3];
        activate8(row, col + 8, gate_lo, gate_hi);
        lo *= gelu_erf(gate_lo);
        hi *= gelu_erf(gate_hi);
    }
    finish8(row, kGeglu ? col / 2 : col, kGeglu ? p.cols / 2 : p.cols, lo, hi);
    if (kMoments) {
        slab[at] = lo;
        slab[at + 1] = hi;
    }
}

// mean and m2 of each column of the slab, to its first two rows: an invocation a column, from the first value on, so that
// a large mean costs no digits
void make_slab_moments(uint slab_at, uint first_row)
{
    const uint in_image = (first_row + p.first_row) % p.moments_image_rows; // its pixels are its first rows
    const uint left = min(p.moments_pixels - min(in_image, p.moments_pixels), p.rows - min(first_row, p.rows));
    const uint count = min(left, kSlab);
    for (uint col = gl_SubgroupInvocationID; col < kSlab; col += gl_SubgroupSize) {
        const uint at = slab_at + col / 4;
        const float first = slab[at][col % 4];
        float d[kSlab], sum = 0.0, m2 = 0.0;
        [[unroll]] for (uint i = 0; i < kSlab; ++i) {
            d[i] = i < count ? slab[at + i * kSlabPitch][col % 4] - first : 0.0;
            sum += d[i];
        }
        const float mean = sum / max(float(count), 1.0);
        [[unroll]] for (uint i = 0; i < kSlab; ++i)
            m2 += i < count ? (d[i] - mean) * (d[i] - mean) : 0.0;
        slab[at][col % 4] = first + mean;
        slab[at + kSlabPitch][col % 4] = m2;
    }
}

// two columns an invocation
void store_slab_moments(uint slab_at, uint first_row, uint first_col)
{
    for (uint pair = gl_SubgroupInvocationID; pair < kSlab / 2; pair += gl_SubgroupSize) {
        const uint col = first_col + 2 * pair, at = slab_at + pair / 2, i = pair % 2 * 2;
        if (first_row < p.rows && col / 8 * 8 < p.cols)
            moments[((epilogue_group * p.rows + first_row) / kMomentRows * p.moments_ld + 2 * col) / 4] =
                vec4(slab[at][i], slab[at + kSlabPitch][i], slab[at][i + 1], slab[at + kSlabPitch][i + 1]);
    }
}

// the sums of slab s of this subgroup. note: compilers must know which sums are stored, or all of them lie in memory
void put_slab(uint s, uint at)
{
    const uint across = kPartN / kSlab;
    [[unroll]] for (uint i = 0; i < kMatsDown * kMatsAcross; ++i) {
        const uint r = i / kMatsAcross * kMatM, c = i % kMatsAcross * kMatN;
        if (r / kSlab * across + c / kSlab == s)
            coopMatStore(sums[i], slab, at + r % kSlab * kSlabPitch + c % kSlab / 4, kSlabPitch,
                         gl_CooperativeMatrixLayoutRowMajor);
    }
}

// Through the slab, as the extension does not say which lane holds which sum. note: unrolled for each slab the epilogue
// would be many times as long.
void store_tile(uint tile_row, uint tile_col)
{
    const uint at = gl_SubgroupID * kSlab * kSlabPitch, across = kPartN / kSlab;
    [[dont_unroll]] for (uint s = 0; s < kPartM / kSlab * across; ++s) {
        const uint row = tile_row + part_row() + s / across * kSlab;
        const uint col = tile_col + part_col() + s % across * kSlab;
        own_barrier();
        put_slab(s, at);
        own_barrier();
        for (uint item = gl_SubgroupInvocationID; item < 2 * kSlab; item += gl_SubgroupSize)
            finish_slab_row(at, item, row, col);
        if (kMoments) {
            own_barrier();
            make_slab_moments(at, row);
            own_barrier();
            store_slab_moments(at, row, col);
        }
    }
}
