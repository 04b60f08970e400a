#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// z = standard normals of Philox4x32-10, key (seed), counter (voxel, draw | stream | channel / 4): the same for a voxel
// whatever batch or order it is computed in. Four channels a thread.
#extension GL_GOOGLE_include_directive : require
#include "lib/philox.glsl"
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform StepNoisePush {
    uint rows;
    uint cols;
    uint z_ld; // elements
    uint seed_low;
    uint seed_high;
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) readonly buffer Cells { ivec4 cells[]; }; // [rows] i, j, k, unused
layout(binding = 3) readonly buffer Known { uint known[]; };  // [rows] 1: a token that is given
layout(binding = 4) writeonly buffer Z { vec4 z[]; };         // [rows, cols]

void main()
{
    const uint per_row = p.z_ld / 4;
    const uint row = linear_thread() / per_row, quad = linear_thread() % per_row;
    if (row >= p.rows)
        return;
    const StepRow s = steps[clock.row];
    const uint stream = s.noise_stream == 2 ? 2 : known[row];
    const uvec4 counter = uvec4(uvec3(cells[row].xyz), s.draw << 12 | stream << 10 | quad);
    vec4 normals = box_muller(philox(counter, uvec2(p.seed_low, p.seed_high)));
    for (uint i = 0; i < 4; ++i)
        normals[i] = quad * 4 + i < p.cols ? normals[i] : 0.0;
    z[row * per_row + quad] = normals;
}
