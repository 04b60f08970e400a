#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// what a step's prediction got wrong of known frames is carried into the others:
//   d = sum over known frames k of weight[step, frame, k] (fixed_k - x0_k);  x0 += d;  x' += c_x0 d
// four elements a thread
#extension GL_GOOGLE_include_directive : require
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform StepCarryPush {
    uint rows; // of x
    uint ld;   // elements, of fixed, x and x0
    uint frames;
    uint frame_rows; // of a frame
    uint first_row;  // of the step table, whose weights come first
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) readonly buffer Weights { float weights[]; };   // [steps, frames, frames]
layout(binding = 3) readonly buffer Known { uint known[]; };        // [frames * frame_rows] 1: of a known frame
layout(binding = 4) readonly buffer Fixed { vec4 fixed_frames[]; }; // [frames * frame_rows, ld]
layout(binding = 5) buffer X { vec4 x[]; };                         // [frames * frame_rows, ld]
layout(binding = 6) buffer X0 { vec4 x0[]; };                       // [frames * frame_rows, ld]

void main()
{
    const uint quads = p.ld / 4, i = linear_thread();
    if (i >= p.rows * quads || known[i / quads] != 0)
        return;
    const uint frame = i / quads / p.frame_rows, in_frame = i - frame * p.frame_rows * quads;
    const uint row = ((clock.row - p.first_row) * p.frames + frame) * p.frames;
    vec4 d = vec4(0);
    for (uint k = 0; k < p.frames; ++k) {
        const uint at = k * p.frame_rows * quads + in_frame;
        if (known[k * p.frame_rows] != 0)
            d += weights[row + k] * (fixed_frames[at] - x0[at]);
    }
    x0[i] += d;
    x[i] += steps[clock.row].c_x0 * d;
}
