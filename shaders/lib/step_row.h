// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_ROW_H
#define SEMROVER_STEP_ROW_H
#include "types.h"

// one row of the step table: engine/sampling/schedule.h, StepCoefficients; read by the kernel that StepClock.row names
struct StepRow {
    float in_scale;
    float x0_x, x0_m;
    float c_x0, c_x, c_m, c_prev, c_z;
    float known_scale, known_noise;
    float c_z_color;     // c_z of the colours of tokens
    uint draw;           // part of the noise key
    uint timestep_index; // into the timesteps of the schedule
    uint noise_stream;   // 0 for target tokens and 1 for known ones in a step; 2 for all in an undo or the first noise
    uint unused0, unused1;
};

// the position of a run in its step table, on the device
struct StepClock {
    uint row;
    uint first_timestep; // timestep_index that row 0 of the modulation table holds
};

#endif
