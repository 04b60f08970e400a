// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SHADE_H
#define SEMROVER_SHADE_H
#include "shaders/lib/types.h"

struct ShadePush {
    uint rows; // pixels of this band
    uint first_row;
    uint width, height;
    uint samples;      // of a pixel
    uint ambient_rays; // of a sample
    uint seed;         // of the noise in directions
};

#endif
