// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SINUSOID_H
#define SEMROVER_SINUSOID_H
#include "shaders/lib/types.h"

struct SinusoidPush {
    uint rows;
    uint axes;        // values of a row of x
    uint frequencies; // per axis
    uint y_ld;        // elements
    uint cosines_lead;   // 1: [cos, sin] per axis, 0: [sin, cos]
};

#endif
