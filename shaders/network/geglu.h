// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_GEGLU_H
#define SEMROVER_GEGLU_H
#include "shaders/lib/types.h"

struct GegluPush {
    uint rows;
    uint cols; // of y, a multiple of 8
    uint x_ld; // elements
    uint y_ld;
};

#endif
