#version 460
// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// table_row = row of the modulation table for the timestep of the current step, for every token
#extension GL_GOOGLE_include_directive : require
#include "lib/step_row.h"
#include "lib/thread.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform StepTimestepPush {
    uint rows;
} p;
layout(binding = 0) readonly buffer Clock { StepClock clock; };
layout(binding = 1) readonly buffer Steps { StepRow steps[]; };
layout(binding = 2) writeonly buffer TableRow { uint table_row[]; }; // [rows]

void main()
{
    if (linear_thread() < p.rows)
        table_row[linear_thread()] = steps[clock.row].timestep_index - clock.first_timestep;
}
