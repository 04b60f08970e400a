#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y = what lies behind x, which is overwritten: what a wrong index in a file would do
#extension GL_GOOGLE_include_directive : require
#include "beyond.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { BeyondPush p; };
layout(binding = 0) buffer X { uint x[]; };           // [count]
layout(binding = 1) writeonly buffer Y { uint y[]; }; // [count]

void main()
{
    const uint i = linear_thread();
    if (i >= p.count)
        return;
    y[i] = x[p.count + i];
    x[p.count + i] = 9;
}
