#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// weight / sqrt(var + eps) and mean of every channel of a group of an image, or of several images together, from the
// moments of chunks of rows, merged in a fixed order as in Chan, Golub and LeVeque 1979. A workgroup a group.
// For devices that are CPUs: they gain nothing by many loads at once.
#extension GL_GOOGLE_include_directive : require
#include "group_norm.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { GroupNormScalePush p; };
layout(binding = 0) readonly buffer Moments { vec2 moments[]; };   // [images * chunks, x_cols] mean, m2
layout(binding = 1) readonly buffer Moments2 { vec2 moments2[]; }; // [images * chunks, x2_cols]
layout(binding = 2) readonly buffer Weight { float weight[]; };    // [x_cols + x2_cols]
layout(binding = 3) writeonly buffer Scale { float scale[]; };     // [2 * sets, x_cols + x2_cols]: scales, then means

shared vec3 partial[64];

// (count, mean, m2) of two disjoint sets
vec3 merge(vec3 a, vec3 b)
{
    const float n = a.x + b.x, share = n > 0.0 ? b.x / n : 0.0, delta = b.y - a.y;
    return vec3(n, a.y + delta * share, a.z + b.z + delta * delta * a.x * share);
}

// chunk: of all images of the set
vec3 load(uint set, uint chunk, uint col)
{
    const uint row = set * p.images * p.chunks + chunk, first = chunk % p.chunks * p.chunk_rows;
    const vec2 m = col < p.x_cols ? moments[row * (p.moments_ld / 2) + col]
                                  : moments2[row * (p.moments2_ld / 2) + col - p.x_cols];
    return vec3(float(min(p.pixels - min(first, p.pixels), p.chunk_rows)), m);
}

void main()
{
    const uint thread = gl_LocalInvocationID.x, group = gl_WorkGroupID.x, set = gl_WorkGroupID.y;
    const uint first = group * p.group_cols;
    vec3 sum = vec3(0.0);
    for (uint i = thread; i < p.images * p.chunks * p.group_cols; i += 64)
        sum = merge(sum, load(set, i / p.group_cols, first + i % p.group_cols));
    partial[thread] = sum;
    for (uint step = 32; step > 0; step /= 2) {
        barrier();
        if (thread < step)
            partial[thread] = merge(partial[thread], partial[thread + step]);
    }
    barrier();
    const float mean = partial[0].y, inverse = inversesqrt(partial[0].z / partial[0].x + p.eps);
    for (uint c = first + thread; c < first + p.group_cols; c += 64) {
        scale[2 * set * p.scale_ld + c] = weight[c] * inverse;
        scale[(2 * set + 1) * p.scale_ld + c] = mean;
    }
}
