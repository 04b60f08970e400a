#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// first[w] = partial[0] + .. + partial[w - 1], total = their sum, capped at 2^32 - 1; one workgroup
#extension GL_GOOGLE_include_directive : require
#include "prefix_sum.h"
#include "lib/workgroup_scan.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { PrefixSumPush p; };
layout(binding = 0) readonly buffer Partial { uint partial[]; }; // [workers]
layout(binding = 1) writeonly buffer First { uint first[]; };    // [workers]
layout(binding = 2) writeonly buffer Total { uint total[]; };    // [1]

shared bool wrapped;

void main()
{
    // a thread owns some partial sums in a row: one scan of the workgroup does for all of them
    const uint t = gl_LocalInvocationID.x, own = (p.workers + 63) / 64;
    const uint begin = min(t * own, p.workers), end = min(begin + own, p.workers);
    wrapped = false;
    uint sum = 0, all;
    for (uint w = begin; w < end; ++w)
        sum += partial[w];
    uint before = scan_workgroup(sum, all); // its barriers come before anyone finds that the sum wrapped
    for (uint w = begin; w < end; ++w) {
        const uint next = before + partial[w];
        first[w] = before;
        if (next < before)
            wrapped = true;
        before = next;
    }
    barrier();
    if (t == 0)
        total[0] = wrapped ? 0xffffffffu : all;
}
