// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_ACCUMULATE_H
#define SEMROVER_ACCUMULATE_H
#include "shaders/lib/types.h"

struct AccumulatePush {
    uint width, height;
    uint words;      // of a picture
    float share;     // of the frame before
    float tolerance; // of depth, relative
    float spread;    // standard deviations around the mean that the frame before is cut to
};

#endif
