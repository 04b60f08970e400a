// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SURFACE_DISTANCE_H
#define SEMROVER_SURFACE_DISTANCE_H
#include "shaders/lib/types.h"

struct SurfaceDistancePush {
    uint size; // points
    uint points_ld;
};

#endif
