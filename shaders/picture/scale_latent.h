// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SCALE_LATENT_H
#define SEMROVER_SCALE_LATENT_H
#include "shaders/lib/types.h"

struct ScaleLatentPush {
    uint rows;   // of y
    uint pixels; // rows that are not padding
    uint cols;   // of y
    uint x_ld;   // elements, of x
    uint y_ld;
    float factor, shift;
};

#endif
