#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = A^T m A + bias + shift + residual per tile of 4 x 4 pixels and channel, four channels a thread
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/pack.glsl"
#include "lib/thread.glsl"
#include "lib/winograd.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeY = kF16;
layout(constant_id = 1) const bool kBias = false;
layout(constant_id = 2) const bool kShift = false;
layout(constant_id = 3) const bool kAdd = false;
layout(constant_id = 4) const uint kTypeResidual = kF16;
layout(push_constant) uniform WinogradOutputPush {
    uint first_tile; // of the band
    uint tiles;      // of the band
    uint tiles_x;    // of an image
    uint image_tiles;
    uint image_rows; // of y
    uint height;
    uint width;
    uint cols;    // channels, padded
    uint outputs; // channels
    uint m_ld; // elements
    uint y_ld;
    uint shift_ld;
    uint shift_col;
    uint residual_ld;
} p;
layout(binding = 0) uniform usamplerBuffer M;                       // [36 * tiles, cols]
layout(binding = 1) readonly buffer Bias { vec4 bias[]; };          // [1, cols]
layout(binding = 2) writeonly buffer Y { uvec2 y[]; };              // [images * image_rows, cols]
layout(binding = 3) readonly buffer Shift { vec4 shift[]; };        // [timesteps, shift_ld]
layout(binding = 4) readonly buffer ShiftRow { uint shift_row[]; }; // [images]
layout(binding = 5) readonly buffer Residual { uvec2 residual[]; }; // as y

void store(uint at, vec4 v)
{
    if (kTypeY == kF16) {
        y[at / 4] = uvec2(pack_halves(v.xy), pack_halves(v.zw));
    } else {
        y[at / 2] = floatBitsToUint(v.xy);
        y[at / 2 + 1] = floatBitsToUint(v.zw);
    }
}

vec4 load_residual(uint at)
{
    if (kTypeResidual == kF16)
        return vec4(unpackHalf2x16(residual[at / 4].x), unpackHalf2x16(residual[at / 4].y));
    return uintBitsToFloat(uvec4(residual[at / 2], residual[at / 2 + 1]));
}

void main()
{
    const uint per_tile = p.cols / 4;
    const uint row = linear_thread() / per_tile, col = linear_thread() % per_tile * 4;
    if (row >= p.tiles)
        return;
    const uint tile = p.first_tile + row, in_image = tile % p.image_tiles;
    const uint image = tile / p.image_tiles * p.image_rows;
    const uint top = in_image / p.tiles_x * kOutputs, left = in_image % p.tiles_x * kOutputs;
    vec4 m[kSamples][kSamples];
    [[unroll]] for (uint i = 0; i < kSamples; ++i) {
        [[unroll]] for (uint j = 0; j < kSamples; ++j)
            m[i][j] = uintBitsToFloat(
                texelFetch(M, int((((i * kSamples + j) * p.tiles + row) * p.m_ld + col) / 4)));
        WINOGRAD_OUTPUT(m[i][0], m[i][1], m[i][2], m[i][3], m[i][4], m[i][5])
    }
    vec4 b = vec4(0.0);
    if (kBias)
        b = bias[col / 4];
    if (kShift)
        b += shift[(shift_row[tile / p.image_tiles] * p.shift_ld + p.shift_col + col) / 4];
    b = mix(vec4(0.0), b, lessThan(uvec4(0, 1, 2, 3) + col, uvec4(p.outputs))); // padding stays zero
    [[unroll]] for (uint j = 0; j < kOutputs; ++j) {
        WINOGRAD_OUTPUT(m[0][j], m[1][j], m[2][j], m[3][j], m[4][j], m[5][j])
        [[unroll]] for (uint i = 0; i < kOutputs; ++i) {
            const uint pixel = image + (top + i) * p.width + left + j;
            if (top + i < p.height && left + j < p.width)
                store(pixel * p.y_ld + col, m[i][j] + b + (kAdd ? load_residual(pixel * p.residual_ld + col) : vec4(0.0)));
        }
    }
    if (in_image == 0) // padding rows
        for (uint r = p.height * p.width; r < p.image_rows; ++r)
            store((image + r) * p.y_ld + col, vec4(0.0));
}
