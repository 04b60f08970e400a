#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// the set bits of a bitmap, ascending
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"
#include "tsdf.h"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push { TsdfPush p; };
layout(binding = 0) readonly buffer Bitmap { uint bitmap[]; };  // [rows]
layout(binding = 1) readonly buffer Ranks { uint ranks[]; };    // [rows] bits before word i
layout(binding = 2) writeonly buffer Blocks { uint blocks[]; }; // [bits]

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows)
        return;
    uint to = ranks[i];
    for (uint word = bitmap[i]; word != 0; word &= word - 1)
        blocks[to++] = i * 32 + findLSB(word);
}
