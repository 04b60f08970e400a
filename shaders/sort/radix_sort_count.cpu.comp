#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// counters[d][w] = keys with digit d in the chunk of worker w; a worker is a thread that counts in its own column of
// global memory, zero at first: on a CPU that is a cache line, while shared memory and its barriers cost
#extension GL_GOOGLE_include_directive : require
#include "radix_sort.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kWorkers = 8; // workers of a workgroup
#include "lib/radix_sort.glsl"
layout(binding = 2) buffer Counters { uint counters[]; }; // [buckets, workers]

void main()
{
    const uint worker = gl_GlobalInvocationID.x;
    if (worker >= p.workers)
        return;
    const uvec2 chunk = chunk_of(worker);
    for (uint i = chunk.x; i < chunk.y; ++i)
        counters[digit_of(keys[i]) * p.workers + worker] += 1;
}
