#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// a z-buffer in metres along z, one pixel a thread: scale / (z - offset), infinite where that is not above 0
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform SplatLimitsPush {
    uint pixels;
} p;
layout(binding = 0) readonly buffer Z { float z[]; };            // [pixels]
layout(binding = 1) readonly buffer Scale { vec2 scale[]; };     // [1] scale, offset
layout(binding = 2) writeonly buffer Limits { float limits[]; }; // [pixels]

void main()
{
    const uint i = linear_thread();
    if (i >= p.pixels)
        return;
    const float above = z[i] - scale[0].y;
    const float metres = above == 0.0 ? 1e30 : scale[0].x / above;
    limits[i] = metres > 0.0 ? metres : 1e30;
}
