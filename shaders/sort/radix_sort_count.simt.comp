#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// counters[d][w] = keys with digit d in the chunk of worker w; a worker is a workgroup that counts in shared memory
#extension GL_GOOGLE_include_directive : require
#include "radix_sort.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kTileM = 1; // workers of a workgroup
layout(constant_id = 1) const uint kTileN = 1;
#include "lib/radix_sort.glsl"
layout(binding = 2) buffer Counters { uint counters[]; }; // [buckets, workers]

shared uint histogram[256];

void main()
{
    const uint worker = gl_WorkGroupID.x, t = gl_LocalInvocationID.x;
    for (uint d = t; d < p.buckets; d += 64)
        histogram[d] = 0;
    barrier();
    const uvec2 chunk = chunk_of(worker);
    for (uint i = chunk.x + t; i < chunk.y; i += 64)
        atomicAdd(histogram[digit_of(keys[i])], 1);
    barrier();
    for (uint d = t; d < p.buckets; d += 64)
        counters[d * p.workers + worker] = histogram[d];
}
