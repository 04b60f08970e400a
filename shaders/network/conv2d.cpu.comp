#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = epilogue(sum over taps and channels of w[n, tap, c] x[pixel at tap, c]), an implicit GEMM with the tiles of
// gemm.cpu.comp: 16 pixels x 16 or 8 channels a lane, p.col_lanes side by side, texel loads, no shared memory. Taps
// outside the image load zeros.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "conv2d.h"
#include "lib/pack.glsl"

layout(local_size_x = 8) in; // lanes, as vectors of 256 bits have
layout(constant_id = 2) const uint kTypeX = kF16;
layout(constant_id = 8) const uint kTypeX2 = kF16;
layout(constant_id = 7) const uint kTypeW = kQ8_0;
layout(constant_id = 3) const uint kKernelHeight = 3;
layout(constant_id = 5) const uint kKernelWidth = 3;
layout(constant_id = 4) const bool kTwoInputs = false;
layout(push_constant) uniform Push { Conv2dPush p; };
layout(binding = 0) uniform usamplerBuffer X;  // [images * in_image_rows, x_cols]
layout(binding = 1) uniform usamplerBuffer W;  // [cols, taps * (x_cols + x2_cols)]
layout(binding = 8) uniform usamplerBuffer X2; // as x, x2_cols
#include "lib/conv_shift.glsl"
#include "lib/gemm_epilogue.glsl"
#define WEIGHT(i) texelFetch(W, int(i))
#include "lib/weight.glsl"
#include "lib/gemm_tile.cpu.glsl"
#include "lib/conv_taps.glsl"

// one input of one tap, whose channels begin at column w_first of a row of w
#define MULTIPLY(IMAGE, type, ld, first, channels, w_first)                                                            \
    {                                                                                                                  \
        uint at[kRows];                                                                                                \
        [[unroll]] for (uint i = 0; i < kRows; ++i)                                                                    \
            at[i] = inside[i] != 0 ? (row[i] - (first)) * (ld) : 0;                                                    \
        for (uint k = 0; k < (channels); k += 8) {                                                                     \
            vec4 lo[kRows], hi[kRows];                                                                                 \
            [[unroll]] for (uint i = 0; i < kRows; ++i)                                                                \
                UNPACK8(type, texelFetch(IMAGE, int((at[i] + k) / 8)) & inside[i],                                     \
                        texelFetch(IMAGE, int((at[i] + k) / 4)) & inside[i],                                           \
                        texelFetch(IMAGE, int((at[i] + k) / 4 + 1)) & inside[i], lo[i], hi[i])                         \
            multiply(lo, hi, w_at, (w_first) + k);                                                                     \
        }                                                                                                              \
    }

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    epilogue_group = 0;
    const uint first_row = gl_WorkGroupID.x * (gl_WorkGroupSize.x / p.col_lanes * kRows) + lane / p.col_lanes * kRows;
    const uint col = gl_WorkGroupID.y * (p.col_lanes * kCols) + lane % p.col_lanes * kCols;
    ConvPixel pixel[kRows];
    uint w_at[kCols];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        pixel[i] = conv_pixel(first_row + i);
    [[unroll]] for (uint j = 0; j < kCols; ++j)
        w_at[j] = weight_row(min(col + j, p.cols - 1));
    clear_tile();
    const uint columns = p.x_cols + p.x2_cols; // of a tap
    for (uint tap = 0; tap < kKernelHeight * kKernelWidth; ++tap) {
        uint row[kRows], inside[kRows]; // inside: all ones, or zero
        [[unroll]] for (uint i = 0; i < kRows; ++i)
            inside[i] = conv_tap(pixel[i], tap / kKernelWidth, tap % kKernelWidth, row[i]) ? 0xffffffffu : 0;
        MULTIPLY(X, kTypeX, p.x_ld, p.x_first, p.x_cols, tap * columns)
        if (kTwoInputs)
            MULTIPLY(X2, kTypeX2, p.x2_ld, p.x2_first, p.x2_cols, tap * columns + p.x_cols)
    }
    store_tile(first_row, col);
}
