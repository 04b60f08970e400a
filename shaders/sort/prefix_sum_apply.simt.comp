#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = x[0] + .. + x[i - 1]; a worker is a workgroup, four elements a thread at a time
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "prefix_sum.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kWorkers = 1; // workers of a workgroup
#include "lib/prefix_sum.glsl"
#include "lib/workgroup_scan.glsl"
layout(binding = 2) readonly buffer First { uint first[]; }; // [workers]
layout(binding = 3) writeonly buffer Y { uint y[]; };        // [size]

void main()
{
    const uint worker = gl_WorkGroupID.x;
    const uvec2 chunk = chunk_of(worker);
    uint carry = first[worker];
    for (uint base = chunk.x; base < chunk.y; base += 256) {
        const uint at = base + gl_LocalInvocationID.x * 4;
        uint value[4], sum = 0, total;
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            value[j] = at + j < chunk.y ? term(at + j) : 0;
            sum += value[j];
        }
        uint before = carry + scan_workgroup(sum, total);
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            if (at + j < chunk.y)
                y[at + j] = before;
            before += value[j];
        }
        carry += total;
    }
}
