// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_CARRY_H
#define SEMROVER_STEP_CARRY_H
#include "shaders/lib/types.h"

struct StepCarryPush {
    uint rows; // of x
    uint ld;   // elements, of fixed, x and x0
    uint frames;
    uint frame_rows; // of a frame
    uint first_row;  // of the step table, whose weights come first
};

#endif
