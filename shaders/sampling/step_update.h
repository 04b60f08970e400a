// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_UPDATE_H
#define SEMROVER_STEP_UPDATE_H
#include "shaders/lib/types.h"

struct StepUpdatePush {
    uint rows;
    uint ld;             // elements, of every matrix
    uint guided;         // 1: rows [rows, 2 rows) of m are the unconditional half
    float guidance;      // of the first frame
    float guidance_step; // from one frame to the next
    uint frame_rows;     // of a frame
    float clip;
};

#endif
