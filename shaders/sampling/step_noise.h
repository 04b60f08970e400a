// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_NOISE_H
#define SEMROVER_STEP_NOISE_H
#include "shaders/lib/types.h"

struct StepNoisePush {
    uint rows;
    uint cols;
    uint z_ld; // elements
    uint seed_low;
    uint seed_high;
};

#endif
