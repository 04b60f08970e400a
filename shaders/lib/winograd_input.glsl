// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0

// The variants of winograd_input differ in how many channels they hold at a time. To be included after
//   CHANNELS           vec4 or vec2
//   PARTS              how many of these are four channels
//   PART(value, part)  those of a vec4
#include "lib/thread.glsl"
#include "lib/winograd.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(push_constant) uniform WinogradInputPush {
    uint first_tile; // of the band
    uint tiles;      // of the band
    uint tiles_x;    // of an image
    uint image_tiles;
    uint image_rows;  // of x
    uint width;       // of x
    uint seen_height; // of the image that the taps see
    uint seen_width;
    uint shift; // 1: every pixel of x stands for two by two
    uint cols;  // channels, padded
    uint x_ld;  // elements
    uint v_ld;
} p;
layout(binding = 0) uniform usamplerBuffer X;             // [images * image_rows, cols]
layout(binding = 1) writeonly buffer V { CHANNELS v[]; }; // [36 * tiles, cols]

// note: a branch a row and none a sample: one each is more than compilers like SwiftShader's end with, and without any
// AMD's loads all 36 samples first, for which it has not the registers
void main()
{
    const uint per_tile = p.cols / 4;
    const uint row = linear_thread() / per_tile, col = linear_thread() % per_tile * 4;
    if (row >= p.tiles)
        return;
    const uint tile = p.first_tile + row, in_image = tile % p.image_tiles;
    const uint image = tile / p.image_tiles * p.image_rows;
    const int top = int(in_image / p.tiles_x * kOutputs) - 1, left = int(in_image % p.tiles_x * kOutputs) - 1;
    [[dont_unroll]] for (uint part = 0; part < PARTS; ++part) {
        CHANNELS d[kSamples][kSamples];
        [[unroll]] for (uint i = 0; i < kSamples; ++i) {
            const uint y = uint(top + int(i));
            [[unroll]] for (uint j = 0; j < kSamples; ++j)
                d[i][j] = CHANNELS(0.0);
            if (y < p.seen_height)
                [[unroll]] for (uint j = 0; j < kSamples; ++j) {
                    const uint x = uint(left + int(j)), pixel = image + (y >> p.shift) * p.width + (x >> p.shift);
                    const bool inside = x < p.seen_width;
                    const uint from = inside ? pixel * p.x_ld + col : 0;
                    const vec4 value = FETCH4(X, kTypeX, from);
                    const CHANNELS own = PART(value, part);
                    d[i][j] = inside ? own : d[i][j];
                }
            WINOGRAD_INPUT(d[i][0], d[i][1], d[i][2], d[i][3], d[i][4], d[i][5])
        }
        [[unroll]] for (uint j = 0; j < kSamples; ++j) {
            WINOGRAD_INPUT(d[0][j], d[1][j], d[2][j], d[3][j], d[4][j], d[5][j])
            [[unroll]] for (uint i = 0; i < kSamples; ++i)
                v[(((i * kSamples + j) * p.tiles + row) * p.v_ld + col) / 4 * PARTS + part] = d[i][j];
        }
    }
}
