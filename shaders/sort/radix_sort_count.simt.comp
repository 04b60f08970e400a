#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// counters[d][w] = keys with digit d in the chunk of worker w; a worker is a workgroup that counts in shared memory
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "radix_sort.h"

layout(local_size_x = 256) in;
layout(constant_id = 0) const uint kWorkers = 1; // workers of a workgroup
#define CHUNK_OF_TILES
#include "lib/radix_sort.glsl"
layout(binding = 2) buffer Counters { uint counters[]; }; // [buckets, workers]

const uint kOwn = kSortTile / 256; // keys of a thread, all of them on their way at once
shared uint histogram[256];

void main()
{
    const uint worker = gl_WorkGroupID.x, t = gl_LocalInvocationID.x;
    histogram[t] = 0;
    barrier();
    const uvec2 chunk = chunk_of(worker);
    for (uint from = chunk.x + t; from < chunk.y; from += kSortTile) {
        uint key[kOwn];
        [[unroll]] for (uint j = 0; j < kOwn; ++j)
            key[j] = keys[min(from + j * 256, chunk.y - 1)];
        [[unroll]] for (uint j = 0; j < kOwn; ++j)
            if (from + j * 256 < chunk.y)
                atomicAdd(histogram[digit_of(key[j])], 1);
    }
    barrier();
    if (t < p.buckets)
        counters[t * p.workers + worker] = histogram[t];
}
