#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = epilogue(sum over taps and channels of w[n, tap, c] x[pixel at tap, c]), an implicit GEMM with the same tiles as
// gemm.simt.comp: 64 pixels x 64 channels a workgroup, or 32 x 32, 16 channels of a tap at a time through shared memory,
// the next ones loaded behind the arithmetic. Taps outside the image load zeros.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "conv2d.h"
#include "lib/pack.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 64;
layout(constant_id = 1) const uint kTileN = 64;
layout(constant_id = 2) const uint kTypeX = kF16;
layout(constant_id = 8) const uint kTypeX2 = kF16;
layout(constant_id = 7) const uint kTypeW = kQ8_0;
layout(constant_id = 3) const uint kKernelHeight = 3;
layout(constant_id = 5) const uint kKernelWidth = 3;
layout(constant_id = 4) const bool kTwoInputs = false;
layout(push_constant) uniform Push { Conv2dPush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };   // [images * in_image_rows, x_cols]
layout(binding = 1) readonly buffer W { uvec4 w[]; };   // [cols, taps * (x_cols + x2_cols)]
layout(binding = 8) readonly buffer X2 { uvec4 x2[]; }; // as x, x2_cols
#include "lib/conv_shift.glsl"
#include "lib/gemm_epilogue.glsl"
#define WEIGHT(i) w[i]
#include "lib/weight.glsl"
#include "lib/gemm_tile.simt.glsl"
#include "lib/conv_taps.glsl"

// position in K: a tap, then 16 channels of the first input and the second one's after them
struct Cursor {
    uint tap, channel;
};

void advance(inout Cursor c)
{
    c.channel += kTileK;
    const uint first = (p.x_cols + kTileK - 1) / kTileK * kTileK; // the second input starts a step of its own
    const uint end = kTwoInputs ? first + p.x2_cols : p.x_cols;
    if (c.channel >= end) {
        c.channel = 0;
        ++c.tap;
    }
}

// this thread's channels of 16, of one row of x and of w; what lies beyond an input's channels is zero
void load(ConvPixel pixel, uint w_row, Cursor c, out vec4 a[4], out vec4 b[4])
{
    [[unroll]] for (uint i = 0; i < 4; ++i)
        a[i] = b[i] = vec4(0.0);
    if (c.tap >= kKernelHeight * kKernelWidth)
        return;
    uint row;
    const bool inside = conv_tap(pixel, c.tap / kKernelWidth, c.tap % kKernelWidth, row);
    const uint first = (p.x_cols + kTileK - 1) / kTileK * kTileK;
    const bool second = kTwoInputs && c.channel >= first;
    const uint channel = second ? c.channel - first : c.channel, cols = second ? p.x2_cols : p.x_cols;
    const uint x_at = second ? (row - p.x2_first) * p.x2_ld : (row - p.x_first) * p.x_ld;
    const uint w_col = c.tap * (p.x_cols + p.x2_cols) + (second ? p.x_cols : 0);
    [[unroll]] for (uint i = 0; i < kBring / 2; ++i) {
        const uint k = channel + bring_k() + 8 * i;
        if (k >= cols)
            continue;
        load_weight8(w_row, w_col + k, b[2 * i], b[2 * i + 1]);
        if (!inside)
            continue;
        if (second) {
            LOAD8(x2, kTypeX2, x_at + k, a[2 * i], a[2 * i + 1]);
        } else {
            LOAD8(x, kTypeX, x_at + k, a[2 * i], a[2 * i + 1]);
        }
    }
}

void main()
{
    epilogue_group = 0;
    const uint row = gl_WorkGroupID.x * kTileM, col = gl_WorkGroupID.y * kTileN;
    const ConvPixel pixel = conv_pixel(row + bring_row());
    const uint w_row = weight_row(min(col + bring_row(), p.cols - 1));
    clear_tile();
    Cursor cursor = Cursor(0, 0);
    vec4 a[4], b[4];
    load(pixel, w_row, cursor, a, b);
    while (cursor.tap < kKernelHeight * kKernelWidth) {
        barrier();
        stage(a, b);
        barrier();
        advance(cursor);
        load(pixel, w_row, cursor, a, b);
        multiply();
    }
    store_tile(row, col);
}
