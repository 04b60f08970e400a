#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = what each thread has read of x, eight loads a round: how fast memory and caches are (semrover bench tiles)
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "factor_rate.h"

layout(local_size_x = 128) in;
layout(constant_id = 2) const uint kTypeX = 1; // fp16, read as words
layout(push_constant) uniform Push { FactorRatePush p; };
layout(binding = 0) readonly buffer X { uvec4 x[]; };
layout(binding = 1) writeonly buffer Y { float y[]; }; // a value of a thread

void main()
{
    const uint thread = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    uint at = thread; // workgroups go through all of x, each from its own place
    uvec4 read = uvec4(0);
    for (uint round = 0; round < p.rounds; ++round)
        [[unroll]] for (uint i = 0; i < 8; ++i) {
            read ^= x[at & (p.units - 1)];
            at += gl_WorkGroupSize.x * 1021;
        }
    const uint all = read.x ^ read.y ^ read.z ^ read.w;
    y[thread] = float((all ^ all >> 16) & 0xffff);
}
