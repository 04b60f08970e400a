// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_STEP_RENOISE_H
#define SEMROVER_STEP_RENOISE_H
#include "shaders/lib/types.h"

struct StepRenoisePush {
    uint rows;
    uint ld; // elements, of x and z
};

#endif
