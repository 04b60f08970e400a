#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = x[0] + .. + x[i - 1]; a worker is a thread
#extension GL_GOOGLE_include_directive : require
#include "prefix_sum.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kWorkers = 8; // workers of a workgroup
#include "lib/prefix_sum.glsl"
layout(binding = 2) readonly buffer First { uint first[]; }; // [workers]
layout(binding = 3) writeonly buffer Y { uint y[]; };        // [size]

void main()
{
    const uint worker = gl_GlobalInvocationID.x;
    if (worker >= p.workers)
        return;
    const uvec2 chunk = chunk_of(worker);
    uint sum = first[worker];
    for (uint i = chunk.x; i < chunk.y; ++i) {
        const uint value = term(i);
        y[i] = sum;
        sum += value;
    }
}
