#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// mean and m2 of `together` chunks of 16 rows of a channel, one thread each: the first stage of the statistics of large
// images
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "group_norm.h"
#include "lib/merge_moments.glsl"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { GroupNormMergePush p; };
layout(binding = 0) readonly buffer Moments { vec2 moments[]; }; // [images * chunks, cols] mean, m2
layout(binding = 1) writeonly buffer Merged { vec2 merged[]; };  // [images * merged, cols]

float count(uint chunk) { return chunk_pixels(chunk, 16, p.pixels); }

void main()
{
    const uint row = linear_thread() / p.cols, col = linear_thread() % p.cols;
    if (row >= p.rows)
        return;
    const uint image = row / p.merged, first = row % p.merged * p.together, end = min(first + p.together, p.chunks);
    const uint ld = p.moments_ld / 2;
    vec3 sum = vec3(0.0);
    MERGE_CHUNKS(sum, moments, image * p.chunks * ld + col, ld, first, 1, end, count)
    merged[row * (p.merged_ld / 2) + col] = sum.yz;
}
