// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_TIMESTEP_H
#define SEMROVER_STEP_TIMESTEP_H
#include "shaders/lib/types.h"

struct StepTimestepPush {
    uint rows;
};

#endif
