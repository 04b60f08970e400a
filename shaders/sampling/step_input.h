// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_INPUT_H
#define SEMROVER_STEP_INPUT_H
#include "shaders/lib/types.h"

struct StepInputPush {
    uint rows; // of y
    uint cols;
    uint x_rows;
    uint x_ld; // elements
    uint y_ld;
};

#endif
