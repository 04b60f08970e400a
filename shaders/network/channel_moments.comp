#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// mean and m2 of 16 rows of eight channels, one thread each: where no pass that made x could take them
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/moments.glsl"
#include "lib/pack.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTypeX = kF16;
layout(push_constant) uniform ChannelMomentsPush {
    uint rows;
    uint cols;
    uint first_row;
    uint x_ld;
    uint moments_ld;
    uint moments_pixels;
    uint moments_image_rows;
} p;
layout(binding = 0) readonly buffer X { uvec4 x[]; };             // [rows, cols]
layout(binding = 1) writeonly buffer Moments { vec4 moments[]; }; // [rows / 16, cols] pairs: mean, m2

void main()
{
    const uint per_chunk = (p.cols + 7) / 8;
    const uint chunk = linear_thread() / per_chunk, col = linear_thread() % per_chunk * 8;
    if (chunk * kMomentRows >= p.rows)
        return;
    ColumnMoments m = no_moments();
    for (uint i = 0; i < kMomentRows; ++i) {
        const uint row = chunk * kMomentRows + i;
        if ((row + p.first_row) % p.moments_image_rows >= p.moments_pixels)
            break;
        vec4 lo, hi;
        LOAD8(x, kTypeX, row * p.x_ld + col, lo, hi);
        add_moments(m, lo, hi);
    }
    vec4 mean[2], m2[2];
    column_moments(m, mean, m2);
    const uint at = (chunk * p.moments_ld + 2 * col) / 4;
    [[unroll]] for (uint i = 0; i < 2; ++i) {
        moments[at + 2 * i] = vec4(mean[i].x, m2[i].x, mean[i].y, m2[i].y);
        moments[at + 2 * i + 1] = vec4(mean[i].z, m2[i].z, mean[i].w, m2[i].w);
    }
}
