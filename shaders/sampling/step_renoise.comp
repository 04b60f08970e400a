#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// x' = c_x x + c_z z: RePaint's step back up, and the first noise (c_x = 0); four elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform StepRenoisePush {
    uint rows;
    uint ld; // elements, of x and z
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) readonly buffer Z { vec4 z[]; }; // [rows, ld]
layout(binding = 3) buffer X { vec4 x[]; };          // [rows, ld]

void main()
{
    const uint i = linear_thread();
    if (i >= p.rows * (p.ld / 4))
        return;
    const StepRow s = steps[clock.row];
    x[i] = s.c_x * x[i] + s.c_z * z[i];
}
