// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_LAYER_NORM_H
#define SEMROVER_LAYER_NORM_H
#include "shaders/lib/types.h"

struct LayerNormPush {
    uint rows;
    uint cols;
    uint x_ld; // elements
    uint y_ld;
    float eps;
};

#endif
