#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// y[i] = value
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform FillPush {
    uint size;
    uint value;
} p;
layout(binding = 0) writeonly buffer Y { uint y[]; };

void main()
{
    const uint i = linear_thread();
    if (i < p.size)
        y[i] = p.value;
}
