// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// kTileM x kTileN outputs of a workgroup as cooperative matrices, fp16 factors and fp32 sums. Its subgroups, kDown of them
// one below the other, own a part each. kTileK columns of K at a time are in shared memory, in one stage or in two; the next
// ones are loaded into registers behind the arithmetic. kernels/network/matmul_tiles sets all of these; all give the same
// bits, as K is summed in one order. Includers say load_next(): next_x and next_w of the next step, false if there is none.
#include "lib/cooperative_matrix.glsl"

layout(constant_id = 34) const uint kTileK = 32; // a multiple of 16 and of kMatK
layout(constant_id = 35) const uint kSubgroups = 4;
layout(constant_id = 37) const uint kDown = 2;
layout(constant_id = 38) const uint kStages = 1;          // 2: one barrier a step in place of two
layout(constant_id = 39) const bool kAhead = false;       // factors are loaded before those in front of them are multiplied
layout(constant_id = 40) const bool kWholeSteps = false;  // no step goes beyond what there is of K
layout(constant_id = 41) const uint kStrip = 16;          // columns that a subgroup finishes at once
layout(constant_id = 42) const uint kRowsOfTiles = 1;     // that workgroups go through together; 1: columns of tiles
const uint kPitch = kTileK + 8; // fp16 of a row: 16 bytes more, so that rows begin in different banks
const uint kPartM = kTileM / kDown, kPartN = kTileN / (kSubgroups / kDown);
const uint kMatsDown = kPartM / kMatM, kMatsAcross = kPartN / kMatN;
const uint kLoadsX = (kTileM * kTileK / 8 + kThreads - 1) / kThreads;
const uint kLoadsW = (kTileN * kTileK / 8 + kThreads - 1) / kThreads;
const uint kSlab = 16, kSlabPitch = kStrip / 4 + 1; // rows that a subgroup finishes at once, and vec4 of a row

// [row][k] and [col][k], eight fp16 each; the first is each subgroup's slab of sums when all is multiplied
const uint kUnitsX = kTileM * kPitch / 8, kUnitsW = kTileN * kPitch / 8, kUnitsSlab = kSubgroups * kSlab * kSlabPitch;
shared uvec4 first_x[kUnitsX > kUnitsSlab ? kUnitsX : kUnitsSlab], first_w[kUnitsW];
shared uvec4 second_x[1 + (kStages - 1) * kUnitsX], second_w[1 + (kStages - 1) * kUnitsW];

#define MatrixX coopmat<float16_t, gl_ScopeSubgroup, kMatM, kMatK, gl_MatrixUseA>
#define MatrixW coopmat<float16_t, gl_ScopeSubgroup, kMatK, kMatN, gl_MatrixUseB>
#define MatrixY coopmat<float, gl_ScopeSubgroup, kMatM, kMatN, gl_MatrixUseAccumulator>

MatrixY sums[kMatsDown * kMatsAcross];
uvec4 next_x[kLoadsX], next_w[kLoadsW]; // of the next step: eight columns of a row each

// which row of the tile, and which columns of the step, load i of this thread brings
uint load_row(uint i) { return (i * kThreads + gl_LocalInvocationID.x) / (kTileK / 8); }
uint load_k() { return gl_LocalInvocationID.x % (kTileK / 8) * 8; } // kThreads is a multiple of kTileK / 8

void clear_tile()
{
    [[unroll]] for (uint i = 0; i < kMatsDown * kMatsAcross; ++i)
        sums[i] = MatrixY(0.0);
}

// first row and column of this subgroup's part
uint part_row() { return gl_SubgroupID % kDown * kPartM; }
uint part_col() { return gl_SubgroupID / kDown * kPartN; }

#define STAGE_X first_x
#define STAGE_W first_w
#define STORE_STAGE store_first
#define MULTIPLY_STAGE multiply_first
#include "lib/gemm_stage.coopmat.glsl"
#define STAGE_X second_x
#define STAGE_W second_w
#define STORE_STAGE store_second
#define MULTIPLY_STAGE multiply_second
#include "lib/gemm_stage.coopmat.glsl"

bool load_next();

void sum_tile()
{
    clear_tile();
    bool more = load_next();
    if (kStages == 1) {
        while (more) {
            barrier();
            store_first();
            barrier();
            more = load_next();
            multiply_first();
        }
    } else {
        store_first();
        while (more) {
            barrier();
            more = load_next();
            multiply_first();
            if (!more)
                break;
            store_second();
            barrier();
            more = load_next();
            multiply_second();
            if (more)
                store_first();
        }
    }
    barrier(); // the slab lies where the first stage did
}

// row and column of tiles of this workgroup
uvec2 tile_place()
{
    if (kRowsOfTiles == 1)
        return gl_WorkGroupID.xy;
    const uint down = (p.rows + kTileM - 1) / kTileM, across = (p.cols + kTileN - 1) / kTileN;
    const uint at = gl_WorkGroupID.y * down + gl_WorkGroupID.x, first = at / (kRowsOfTiles * across) * kRowsOfTiles;
    const uint rows = min(down - first, kRowsOfTiles), in_rows = at - first * across;
    return uvec2(first + in_rows % rows, in_rows / rows);
}

vec4 slab(uint at) { return uintBitsToFloat(first_x[at]); }

// eight columns of a row of the slab; with GEGLU the eight after them are their gates
void finish_slab_row(uint slab_at, uint item, uint first_row, uint first_col)
{
    const uint eight = item % (kStrip / 8), in_slab = item / (kStrip / 8);
    const uint row = first_row + in_slab, col = first_col + eight * 8;
    const uint at = slab_at + in_slab * kSlabPitch + eight * 2;
    vec4 lo = slab(at), hi = slab(at + 1);
    if (row >= p.rows || col >= p.cols || (kGeglu && eight % 2 != 0))
        return;
    if (kSlices > 1) { // beside each other in a row: split_k_reduce adds them
        STORE8(y, kF32, row * p.y_ld + gl_WorkGroupID.z * (p.y_ld / kSlices) + col, lo, hi);
        return;
    }
    activate8(row, col, lo, hi);
    if (kGeglu) {
        vec4 gate_lo = slab(at + 2), gate_hi = slab(at + 3);
        activate8(row, col + 8, gate_lo, gate_hi);
        lo *= gelu_erf(gate_lo);
        hi *= gelu_erf(gate_hi);
    }
    finish8(row, kGeglu ? col / 2 : col, kGeglu ? p.cols / 2 : p.cols, lo, hi);
    if (kMoments) {
        first_x[at] = floatBitsToUint(lo);
        first_x[at + 1] = floatBitsToUint(hi);
    }
}

// mean and m2 of each column of the slab, to its first two rows: an invocation a column, from the first value on, so that
// a large mean costs no digits
void make_slab_moments(uint slab_at, uint first_row)
{
    const uint in_image = (first_row + p.first_row) % p.moments_image_rows; // its pixels are its first rows
    const uint left = min(p.moments_pixels - min(in_image, p.moments_pixels), p.rows - min(first_row, p.rows));
    const uint count = min(left, kSlab);
    for (uint col = gl_SubgroupInvocationID; col < kStrip; col += gl_SubgroupSize) {
        const uint at = slab_at + col / 4;
        const float first = slab(at)[col % 4];
        float d[kSlab], sum = 0.0, m2 = 0.0;
        [[unroll]] for (uint i = 0; i < kSlab; ++i) {
            d[i] = i < count ? slab(at + i * kSlabPitch)[col % 4] - first : 0.0;
            sum += d[i];
        }
        const float mean = sum / max(float(count), 1.0);
        [[unroll]] for (uint i = 0; i < kSlab; ++i)
            m2 += i < count ? (d[i] - mean) * (d[i] - mean) : 0.0;
        first_x[at][col % 4] = floatBitsToUint(first + mean);
        first_x[at + kSlabPitch][col % 4] = floatBitsToUint(m2);
    }
}

// two columns an invocation
void store_slab_moments(uint slab_at, uint first_row, uint first_col)
{
    for (uint pair = gl_SubgroupInvocationID; pair < kStrip / 2; pair += gl_SubgroupSize) {
        const uint col = first_col + 2 * pair, at = slab_at + pair / 2, i = pair % 2 * 2;
        if (first_row < p.rows && col / 8 * 8 < p.cols)
            moments[((epilogue_group * p.rows + first_row) / kMomentRows * p.moments_ld + 2 * col) / 4] =
                vec4(slab(at)[i], slab(at + kSlabPitch)[i], slab(at)[i + 1], slab(at + kSlabPitch)[i + 1]);
    }
}

// the sums of slab s of this subgroup. note: compilers must know which sums are stored, or all of them lie in memory
void put_slab(uint s, uint at)
{
    const uint across = kPartN / kStrip;
    [[unroll]] for (uint i = 0; i < kMatsDown * kMatsAcross; ++i) {
        const uint r = i / kMatsAcross * kMatM, c = i % kMatsAcross * kMatN;
        if (r / kSlab * across + c / kStrip == s)
            coopMatStore(sums[i], first_x, at + r % kSlab * kSlabPitch + c % kStrip / 4, kSlabPitch,
                         gl_CooperativeMatrixLayoutRowMajor);
    }
}

// Through the slab, as the extension does not say which lane holds which sum. note: unrolled for each slab the epilogue
// would be many times as long.
void store_tile(uint tile_row, uint tile_col)
{
    const uint at = gl_SubgroupID * kSlab * kSlabPitch, across = kPartN / kStrip;
    [[dont_unroll]] for (uint s = 0; s < kPartM / kSlab * across; ++s) {
        const uint row = tile_row + part_row() + s / across * kSlab;
        const uint col = tile_col + part_col() + s % across * kStrip;
        own_barrier();
        put_slab(s, at);
        own_barrier();
        for (uint item = gl_SubgroupInvocationID; item < kSlab * kStrip / 8; item += gl_SubgroupSize)
            finish_slab_row(at, item, row, col);
        if (kMoments) {
            own_barrier();
            make_slab_moments(at, row);
            own_barrier();
            store_slab_moments(at, row, col);
        }
    }
}
