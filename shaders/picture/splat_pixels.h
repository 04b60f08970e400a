// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SPLAT_PIXELS_H
#define SEMROVER_SPLAT_PIXELS_H
#include "shaders/lib/types.h"

struct SplatPixelsPush {
    uint pixels;
    float red, green, blue; // of the background, 0..255
    float visible_alpha;
};

#endif
