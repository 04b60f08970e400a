#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// counts[i] = set bits of word i
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "tsdf.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TsdfPush p; };
layout(binding = 0) readonly buffer Bitmap { uint bitmap[]; };  // [rows]
layout(binding = 1) writeonly buffer Counts { uint counts[]; }; // [rows]

void main()
{
    const uint i = linear_thread();
    if (i < p.rows)
        counts[i] = bitCount(bitmap[i]);
}
