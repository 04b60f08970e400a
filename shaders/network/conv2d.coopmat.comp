#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = epilogue(sum over taps and channels of w[n, tap, c] x[pixel at tap, c]) of fp16 factors, for GPUs with matrix
// units: an implicit GEMM with the tiles of gemm.coopmat.comp, kTileK channels of a tap at a time.
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
#define WEIGHT(i) w[i]
#include "lib/weight.coopmat.glsl"
#include "lib/conv_taps.glsl"
#include "lib/gemm_tile.coopmat.glsl"

// position in K: a tap, then channels of the first input and, from a step of their own on, the second one's
struct Cursor {
    uint tap, channel;
};

Cursor cursor, end;          // of the next step, and behind the last one
ConvPixel pixels[kLoadsX];   // of the rows that this thread brings
uint aimed_tap = ~0u, aimed_input = 0; // that x_at are of
uint x_at[kLoadsX], w_at[kLoadsW];     // texels of these rows: x from its columns on
uint inside_image;                     // bit i: load i of x reads a pixel, else zeros

const uint kRun = 128; // channels, or the last ones of an input: slices of K are cut there, whatever kTileK is

uint second_begins() { return (p.x_cols + kTileK - 1) / kTileK * kTileK; }

Cursor start_of(uint slice)
{
    const uint runs = (p.x_cols + kRun - 1) / kRun, all = runs + (p.x2_cols + kRun - 1) / kRun;
    const uint run = slice * (kKernelHeight * kKernelWidth * all) / kSlices, in_tap = run % all;
    return Cursor(run / all, in_tap < runs ? in_tap * kRun : second_begins() + (in_tap - runs) * kRun);
}

bool before(Cursor a, Cursor b) { return a.tap < b.tap || (a.tap == b.tap && a.channel < b.channel); }

void advance()
{
    cursor.channel += kTileK;
    if (cursor.channel >= (kTwoInputs ? second_begins() + p.x2_cols : p.x_cols)) {
        cursor.channel = 0;
        ++cursor.tap;
    }
}

// at the pixels of a tap: once for all of its channels of an input
void aim(uint tap, uint second)
{
    aimed_tap = tap;
    aimed_input = second;
    inside_image = 0;
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i) {
        uint row;
        if (conv_tap(pixels[i], tap / kKernelWidth, tap % kKernelWidth, row))
            inside_image |= 1u << i;
        const uint in_x = (row - p.x_first) * p.x_ld, in_x2 = (row - p.x2_first) * p.x2_ld;
        x_at[i] = ((second != 0 ? in_x2 : in_x) + load_k()) / 8;
    }
}

void start_loads(uint tile_row, uint tile_col, uint slice)
{
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i)
        pixels[i] = conv_pixel(tile_row + load_row(i));
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i)
        w_at[i] = weight_row(min(tile_col + load_row(i), p.cols - 1));
    cursor = start_of(slice);
    end = start_of(slice + 1);
}

bool load_next()
{
    if (!before(cursor, end))
        return false;
    const uint second = uint(kTwoInputs && cursor.channel >= second_begins());
    if (cursor.tap != aimed_tap || second != aimed_input)
        aim(cursor.tap, second);
    const uint channel = cursor.channel - second * second_begins();
    const bool inside = kWholeSteps || channel + load_k() < (second != 0 ? p.x2_cols : p.x_cols);
    [[unroll]] for (uint i = 0; i < kLoadsX; ++i) {
        next_x[i] = uvec4(0);
        if (!inside || (inside_image >> i & 1) == 0)
            continue;
        if (second != 0)
            next_x[i] = x2[x_at[i] + channel / 8];
        else
            next_x[i] = x[x_at[i] + channel / 8];
    }
    const uint w_from = cursor.tap * (p.x_cols + p.x2_cols) + second * p.x_cols + channel + load_k();
    [[unroll]] for (uint i = 0; i < kLoadsW; ++i)
        next_w[i] = inside ? load_weight_halves(w_at[i], w_from) : uvec4(0);
    advance();
    return true;
}

void main()
{
    epilogue_group = 0;
    const uvec2 first = tile_place() * uvec2(kTileM, kTileN);
    start_loads(first.x, first.y, gl_WorkGroupID.z);
    sum_tile();
    store_tile(first.x, first.y);
}
