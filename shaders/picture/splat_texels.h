// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SPLAT_TEXELS_H
#define SEMROVER_SPLAT_TEXELS_H
#include "shaders/lib/types.h"

struct SplatTexelsPush {
    uint pixels;  // of a camera
    uint numbers; // of a pixel, as splats are drawn
    uint words;   // of a camera, as they are wanted
    uint cameras;
};

#endif
