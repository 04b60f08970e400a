#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = epilogue(sum over taps and channels of w[n, tap, c] x[pixel at tap, c]) of fp16 factors, for GPUs with matrix
// units: an implicit GEMM with the tiles of gemm.coopmat.comp, kStep channels of a tap at a time.
// tools/dev/spirv compiles it.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
#extension GL_KHR_cooperative_matrix : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#include "conv2d.h"
#include "lib/pack.glsl"

layout(local_size_x = 128, local_size_x_id = 33) in; // kThreads
layout(constant_id = 0) const uint kTileM = 128;
layout(constant_id = 1) const uint kTileN = 128;
layout(constant_id = 7) const uint kTypeW = kQ8_0;
layout(constant_id = 3) const uint kKernelHeight = 3;
layout(constant_id = 5) const uint kKernelWidth = 3;
layout(constant_id = 4) const bool kTwoInputs = false;
layout(push_constant) uniform Push { Conv2dPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };   // [images * in_image_rows, x_cols], fp16
layout(binding = 1) readonly buffer W { uvec4 w[]; };   // [cols, taps * (x_cols + x2_cols)]
layout(binding = 8) readonly buffer X2 { uvec4 x2[]; }; // as x, x2_cols
#include "lib/conv_shift.glsl"
#include "lib/gemm_epilogue.glsl"
layout(constant_id = 36) const uint kSlices = 1; // of K, each summed by workgroups of its own, which write fp32 sums to Y
#include "lib/gemm_tile.coopmat.glsl"
#define WEIGHT(i) w[i]
#include "lib/weight.coopmat.glsl"
#include "lib/conv_taps.glsl"

ConvPixel pixels[kLoadsX]; // of the rows that this thread brings

// position in K: a tap, then channels of the first input and the second one's after them
struct Cursor {
    uint tap, channel;
};

const uint kRun = 128; // channels, or the last ones of an input: slices of K are cut there, whatever kStep is

Cursor start_of(uint slice)
{
    const uint runs = (p.x_cols + kRun - 1) / kRun, all = runs + (p.x2_cols + kRun - 1) / kRun;
    const uint run = slice * (kKernelHeight * kKernelWidth * all) / kSlices, in_tap = run % all;
    const uint first = (p.x_cols + kStep - 1) / kStep * kStep;
    return Cursor(run / all, in_tap < runs ? in_tap * kRun : first + (in_tap - runs) * kRun);
}

bool before(Cursor a, Cursor b) { return a.tap < b.tap || (a.tap == b.tap && a.channel < b.channel); }

void advance(inout Cursor c)
{
    c.channel += kStep;
    const uint first = (p.x_cols + kStep - 1) / kStep * kStep; // the second input starts a step of its own
    const uint end = kTwoInputs ? first + p.x2_cols : p.x_cols;
    if (c.channel >= end) {
        c.channel = 0;
        ++c.tap;
    }
}

// kStep channels of the tile's rows of x and of w; what lies beyond an input's channels is zero
void load(uint tile_col, Cursor c)
{
    const uint first = (p.x_cols + kStep - 1) / kStep * kStep;
    const bool second = kTwoInputs && c.channel >= first;
    const uint channel = (second ? c.channel - first : c.channel) + load_k();
    const bool inside = c.tap < kKernelHeight * kKernelWidth && channel < (second ? p.x2_cols : p.x_cols);
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i) {
        uint row;
        next_x[i] = uvec4(0);
        if (!conv_tap(pixels[i], c.tap / kKernelWidth, c.tap % kKernelWidth, row) || !inside)
            continue;
        if (second)
            next_x[i] = x2[((row - p.x2_first) * p.x2_ld + channel) / 8];
        else
            next_x[i] = x[((row - p.x_first) * p.x_ld + channel) / 8];
    }
    const uint w_at = c.tap * (p.x_cols + p.x2_cols) + (second ? p.x_cols : 0) + channel;
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i) {
        const uint row = min(tile_col + load_row(i), p.cols - 1);
        next_w[i] = inside ? load_weight_halves(weight_row(row), w_at) : uvec4(0);
    }
}

void main()
{
    epilogue_group = 0;
    const uint row = gl_WorkGroupID.x * kTileM, col = gl_WorkGroupID.y * kTileN;
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i)
        pixels[i] = conv_pixel(row + load_row(i));
    clear_tile();
    Cursor cursor = start_of(gl_WorkGroupID.z);
    const Cursor end = start_of(gl_WorkGroupID.z + 1);
    load(col, cursor);
    while (before(cursor, end)) {
        barrier();
        stage();
        barrier();
        advance(cursor);
        load(col, cursor);
        multiply();
    }
    store_tile(row, col);
}
