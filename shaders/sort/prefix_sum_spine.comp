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
    const uint t = gl_LocalInvocationID.x;
    uint carry = 0;
    wrapped = false;
    for (uint base = 0; base < p.workers; base += 64) {
        const uint w = base + t, own = w < p.workers ? partial[w] : 0;
        uint sum;
        const uint before = carry + scan_workgroup(own, sum);
        if (w < p.workers)
            first[w] = before;
        if (before + own < before)
            wrapped = true;
        carry += sum;
    }
    barrier();
    if (t == 0)
        total[0] = wrapped ? 0xffffffffu : carry;
}
