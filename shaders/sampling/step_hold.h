// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_HOLD_H
#define SEMROVER_STEP_HOLD_H
#include "shaders/lib/types.h"

struct StepHoldPush {
    uint rows;
    uint ld; // elements, of fixed and x
};

#endif
