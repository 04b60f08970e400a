#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// one denoising step of any sampler, four elements a thread:
//   m = u + guidance (c - u), guidance linear over the frames
//   x0 = clamp(x0_x x + x0_m m, -clip, clip)
//   x' = c_x0 x0 + c_x x + c_m m + c_prev x0_prev + c_z z;  known tokens: x' = known_scale fixed + known_noise z
// c_z is c_z_color for the last three of each six numbers of a row, which are the colour of a token's point
#extension GL_GOOGLE_include_directive : require
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform StepUpdatePush {
    uint rows;
    uint ld;             // elements, of every matrix
    uint guided;         // 1: rows [rows, 2 rows) of m are the unconditional half
    float guidance;      // of the first frame
    float guidance_step; // from one frame to the next
    uint frame_rows;     // of a frame
    float clip;
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) readonly buffer M { vec4 m[]; };         // [(1 + guided) rows, ld]
layout(binding = 3) readonly buffer Z { vec4 z[]; };         // [rows, ld]
layout(binding = 4) readonly buffer Known { uint known[]; }; // [rows]
layout(binding = 5) readonly buffer Fixed { vec4 fixed_tokens[]; }; // [rows, ld]
layout(binding = 6) buffer X { vec4 x[]; };                  // [rows, ld]
layout(binding = 7) buffer X0 { vec4 x0[]; };                // [rows, ld] prediction of the step before, then of this one

vec4 noise_scale(StepRow s, uint first)
{
    const uvec4 of_point = (first + uvec4(0, 1, 2, 3)) % 6;
    return mix(vec4(s.c_z), vec4(s.c_z_color), greaterThanEqual(of_point, uvec4(3)));
}

void main()
{
    const uint i = linear_thread(), quads = p.ld / 4;
    if (i >= p.rows * quads)
        return;
    const StepRow s = steps[clock.row];
    vec4 prediction = m[i];
    if (p.guided != 0) {
        const vec4 unconditional = m[i + p.rows * quads];
        const float guidance = p.guidance + p.guidance_step * float(i / quads / p.frame_rows);
        prediction = unconditional + guidance * (prediction - unconditional);
    }
    const vec4 start = clamp(s.x0_x * x[i] + s.x0_m * prediction, -p.clip, p.clip);
    vec4 next = s.c_x0 * start + s.c_x * x[i] + s.c_m * prediction + s.c_prev * x0[i] +
                noise_scale(s, i % quads * 4) * z[i];
    if (known[i / quads] != 0)
        next = s.known_scale * fixed_tokens[i] + s.known_noise * z[i];
    x[i] = next;
    x0[i] = start;
}
