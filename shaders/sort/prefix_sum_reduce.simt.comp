#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// partial[w] = sum of x over the chunk of worker w; a worker is a workgroup
#extension GL_GOOGLE_include_directive : require
#include "prefix_sum.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kWorkers = 1; // workers of a workgroup
#include "lib/prefix_sum.glsl"
#include "lib/workgroup_scan.glsl"
layout(binding = 2) writeonly buffer Partial { uint partial[]; }; // [workers]

void main()
{
    const uint worker = gl_WorkGroupID.x, t = gl_LocalInvocationID.x;
    const uvec2 chunk = chunk_of(worker);
    uint sum = 0, total;
    for (uint i = chunk.x + t; i < chunk.y; i += 64)
        sum += term(i);
    scan_workgroup(sum, total);
    if (t == 0)
        partial[worker] = total;
}
