#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// partial[w] = sum of x over the chunk of worker w; a worker is a thread
#extension GL_GOOGLE_include_directive : require
#include "prefix_sum.h"

layout(local_size_x = 8) in;
layout(constant_id = 0) const uint kWorkers = 8; // workers of a workgroup
#include "lib/prefix_sum.glsl"
layout(binding = 2) writeonly buffer Partial { uint partial[]; }; // [workers]

void main()
{
    const uint worker = gl_GlobalInvocationID.x;
    if (worker >= p.workers)
        return;
    const uvec2 chunk = chunk_of(worker);
    uint sum = 0;
    for (uint i = chunk.x; i < chunk.y; ++i)
        sum += term(i);
    partial[worker] = sum;
}
