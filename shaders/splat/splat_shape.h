// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SPLAT_SHAPE_H
#define SEMROVER_SPLAT_SHAPE_H
#include "shaders/lib/types.h"

struct SplatShapePush {
    uint rows;      // points
    uint neighbors; // of a point
    float sigma;    // metres
    float spacing;  // sigma = spacing times the distance of the nearest points; 0: always `sigma`
    float smallest; // of such a sigma, metres
    float largest;
};

#endif
