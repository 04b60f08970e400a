#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[n] = epilogue(sum over taps and channels of w[n, tap, c] x[pixel at tap, c]), an implicit GEMM with the same tiles as
// gemm.cpu.comp: 16 pixels x 16 channels a lane, p.col_lanes side by side, texel loads, no shared memory. Taps outside the
// image load zeros.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "conv2d.h"

layout(local_size_x = 8, local_size_x_id = 33) in; // kLanes
layout(constant_id = 33) const uint kLanes = 8; // a subgroup: 8, or 16 where vectors have 512 bits
layout(constant_id = 2) const bool kHalfX = false; // w and x2 have the type of x
layout(constant_id = 3) const uint kKernelHeight = 3;
layout(constant_id = 5) const uint kKernelWidth = 3;
layout(constant_id = 4) const bool kTwoInputs = false;
layout(push_constant) uniform Push { Conv2dPush p; };
layout(binding = 0) uniform usamplerBuffer X;  // [images * in_image_rows, x_cols]
layout(binding = 1) uniform usamplerBuffer W;  // [cols, taps * (x_cols + x2_cols)]
layout(binding = 8) uniform usamplerBuffer X2; // as x, x2_cols
#include "lib/conv_shift.glsl"
#include "lib/gemm_epilogue.glsl"
#include "lib/gemm_tile.cpu.glsl"
#include "lib/conv_taps.glsl"

// one input of one tap; a texel is 8 or 4 channels
#define MULTIPLY(IMAGE, ld, first, channels, w_first)                                                                  \
    {                                                                                                                  \
        uint at[kRows];                                                                                                \
        [[unroll]] for (uint i = 0; i < kRows; ++i)                                                                    \
            at[i] = inside[i] != 0 ? (row[i] - (first)) * ((ld) / width) : 0;                                          \
        if (kHalfX) {                                                                                                  \
            for (uint k = 0; k < (channels) / 8; ++k) {                                                                \
                vec4 lo[kRows], hi[kRows];                                                                             \
                [[unroll]] for (uint i = 0; i < kRows; ++i)                                                            \
                    unpack8(texelFetch(IMAGE, int(at[i] + k)) & inside[i], lo[i], hi[i]);                              \
                multiply_half(lo, hi, w_at, (w_first) + k);                                                            \
            }                                                                                                          \
        } else {                                                                                                       \
            for (uint k = 0; k < (channels) / 4; ++k) {                                                                \
                vec4 a[kRows];                                                                                         \
                [[unroll]] for (uint i = 0; i < kRows; ++i)                                                            \
                    a[i] = uintBitsToFloat(texelFetch(IMAGE, int(at[i] + k)) & inside[i]);                             \
                multiply_float(a, w_at, (w_first) + k);                                                                \
            }                                                                                                          \
        }                                                                                                              \
    }

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    epilogue_group = 0;
    const uint first_row = gl_WorkGroupID.x * (kLanes / p.col_lanes * kRows) + lane / p.col_lanes * kRows;
    const uint col = gl_WorkGroupID.y * (p.col_lanes * kCols) + lane % p.col_lanes * kCols;
    const uint width = kHalfX ? 8 : 4; // elements of a texel
    ConvPixel pixel[kRows];
    uint w_at[kCols];
    [[unroll]] for (uint i = 0; i < kRows; ++i)
        pixel[i] = conv_pixel(first_row + i);
    [[unroll]] for (uint j = 0; j < kCols; ++j)
        w_at[j] = min(col + j, p.cols - 1) * (p.w_ld / width);
    clear_tile();
    const uint texels = (p.x_cols + p.x2_cols) / width;
    for (uint tap = 0; tap < kKernelHeight * kKernelWidth; ++tap) {
        uint row[kRows], inside[kRows]; // inside: all ones, or zero
        [[unroll]] for (uint i = 0; i < kRows; ++i)
            inside[i] = conv_tap(pixel[i], tap / kKernelWidth, tap % kKernelWidth, row[i]) ? 0xffffffffu : 0;
        MULTIPLY(X, p.x_ld, p.x_first, p.x_cols, tap * texels)
        if (kTwoInputs)
            MULTIPLY(X2, p.x2_ld, p.x2_first, p.x2_cols, tap * texels + p.x_cols / width)
    }
    store_tile(first_row, col);
}
