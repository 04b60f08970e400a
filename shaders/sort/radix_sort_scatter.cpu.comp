#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// pair i goes to first[digit][worker] + pairs with that digit before it in the chunk; a worker is a thread that keeps
// its places in its own column of `first`
#extension GL_GOOGLE_include_directive : require
#include "radix_sort.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kWorkers = 8; // workers of a workgroup
#include "lib/radix_sort.glsl"
layout(binding = 2) readonly buffer Values { uint values[]; };
layout(binding = 3) buffer First { uint first[]; }; // [buckets, workers]
layout(binding = 4) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 5) writeonly buffer SortedValues { uint sorted_values[]; };

void main()
{
    const uint worker = gl_GlobalInvocationID.x;
    if (worker >= p.workers)
        return;
    const uvec2 chunk = chunk_of(worker);
    for (uint i = chunk.x; i < chunk.y; ++i) {
        const uint key = keys[i], column = digit_of(key) * p.workers + worker;
        const uint to = first[column];
        first[column] = to + 1;
        sorted_keys[to] = key;
        sorted_values[to] = kIota ? i : values[i];
    }
}
