#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// x = fixed where a token is known: for networks that see known tokens without noise; four elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform StepHoldPush {
    uint rows;
    uint ld; // elements, of fixed and x
} p;
layout(binding = 0) readonly buffer Known { uint known[]; };        // [rows] 1: a token that is given
layout(binding = 1) readonly buffer Fixed { vec4 fixed_tokens[]; }; // [rows, ld]
layout(binding = 2) buffer X { vec4 x[]; };                         // [rows, ld]

void main()
{
    const uint i = linear_thread(), quads = p.ld / 4;
    if (i < p.rows * quads && known[i / quads] != 0)
        x[i] = fixed_tokens[i];
}
