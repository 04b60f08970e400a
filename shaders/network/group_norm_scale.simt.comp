#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// weight / sqrt(var + eps) and mean of every channel of a group of an image, or of several images together, from the
// moments of chunks of rows, merged in a fixed order. A workgroup a group.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "group_norm.h"
#include "lib/merge_moments.glsl"

layout(local_size_x = 128) in;
layout(push_constant) uniform Push { GroupNormScalePush p; };
layout(binding = 0) readonly buffer Moments { vec2 moments[]; };   // [images * chunks, x_cols] mean, m2
layout(binding = 1) readonly buffer Moments2 { vec2 moments2[]; }; // [images * chunks, x2_cols]
layout(binding = 2) readonly buffer Weight { float weight[]; };    // [x_cols + x2_cols]
layout(binding = 3) writeonly buffer Scale { float scale[]; };     // [2 * sets, x_cols + x2_cols]: scales, then means

const uint kThreads = 128;
shared vec3 partial[kThreads];

// chunk: of all images of the set
float count(uint chunk)
{
    if (p.images > 1)
        chunk %= p.chunks;
    return chunk_pixels(chunk, p.chunk_rows, p.pixels);
}

// of one column: chunks first, first + stride, ..., after `sum`
vec3 add_column(vec3 sum, uint set, uint col, uint first, uint stride)
{
    const uint chunks = p.images * p.chunks, ld = p.moments_ld / 2, ld2 = p.moments2_ld / 2;
    if (col < p.x_cols) {
        MERGE_CHUNKS(sum, moments, set * chunks * ld + col, ld, first, stride, chunks, count)
    } else {
        MERGE_CHUNKS(sum, moments2, set * chunks * ld2 + col - p.x_cols, ld2, first, stride, chunks, count)
    }
    return sum;
}

// leaves what all threads have with the first ones
void merge_threads(uint left)
{
    const uint thread = gl_LocalInvocationID.x;
    barrier();
    if (thread < left) {
        vec3 sets[kAtOnce];
        [[unroll]] for (uint i = 0; i < kAtOnce; ++i)
            sets[i] = partial[thread + i * left];
        partial[thread] = merge(sets, vec3(0.0));
    }
}

void main()
{
    const uint thread = gl_LocalInvocationID.x, group = gl_WorkGroupID.x, set = gl_WorkGroupID.y;
    const uint first = group * p.group_cols;
    // threads side by side read columns side by side
    const uint across = min(p.group_cols, kThreads), down = kThreads / across;
    vec3 sum = vec3(0.0);
    if (thread < across * down)
        for (uint c = thread % across; c < p.group_cols; c += across)
            sum = add_column(sum, set, first + c, thread / across, down);
    partial[thread] = sum;
    merge_threads(kThreads / kAtOnce);
    merge_threads(kThreads / kAtOnce / kAtOnce);
    barrier();
    vec3 last[kAtOnce];
    [[unroll]] for (uint i = 0; i < kAtOnce; ++i)
        last[i] = i < kThreads / kAtOnce / kAtOnce ? partial[i] : vec3(0.0);
    sum = merge(last, vec3(0.0));
    const float mean = sum.y, inverse = inversesqrt(sum.z / sum.x + p.eps);
    for (uint c = first + thread; c < first + p.group_cols; c += kThreads) {
        scale[2 * set * p.scale_ld + c] = weight[c] * inverse;
        scale[(2 * set + 1) * p.scale_ld + c] = mean;
    }
}
