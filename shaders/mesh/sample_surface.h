// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SAMPLE_SURFACE_H
#define SEMROVER_SAMPLE_SURFACE_H
#include "shaders/lib/types.h"

struct SampleSurfacePush {
    uint cells;
    uint samples; // of a voxel
    uint seed_low;
    uint seed_high;
};

#endif
