#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// U = G w G^T per output and channel, four channels a thread
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/thread.glsl"
#include "lib/winograd.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeW = kQ8_0;
layout(push_constant) uniform WinogradWeightPush {
    uint outputs;
    uint cols; // channels, padded
    uint w_ld; // elements
    uint u_ld;
} p;
layout(binding = 0) uniform usamplerBuffer W;         // [outputs, 9 * cols]
layout(binding = 1) writeonly buffer U { vec4 u[]; }; // [36 * outputs, cols]
#define WEIGHT(i) texelFetch(W, int(i))
#include "lib/weight.glsl"

// four elements of a row from k on, a multiple of 4
vec4 load_weight4(uint row, uint k)
{
    if (kTypeW != kQ8_0)
        return FETCH4(W, kTypeW, row * p.w_ld + k);
    const uint row_at = weight_row(row);
    return block_scale(row_at, k) * signed_bytes(WEIGHT(row_at + k / 16)[k / 4 % 4]);
}

void main()
{
    const uint per_row = p.cols / 4;
    const uint n = linear_thread() / per_row, col = linear_thread() % per_row * 4;
    if (n >= p.outputs)
        return;
    vec4 rows[kSamples][3];
    [[unroll]] for (uint j = 0; j < 3; ++j) {
        vec4 g[3], column[kSamples];
        [[unroll]] for (uint i = 0; i < 3; ++i)
            g[i] = load_weight4(n, (i * 3 + j) * p.cols + col);
        WINOGRAD_WEIGHT(g[0], g[1], g[2], column)
        [[unroll]] for (uint i = 0; i < kSamples; ++i)
            rows[i][j] = column[i];
    }
    [[unroll]] for (uint i = 0; i < kSamples; ++i) {
        vec4 row[kSamples];
        WINOGRAD_WEIGHT(rows[i][0], rows[i][1], rows[i][2], row)
        [[unroll]] for (uint j = 0; j < kSamples; ++j)
            u[(((i * kSamples + j) * p.outputs + n) * p.u_ld + col) / 4] = row[j];
    }
}
