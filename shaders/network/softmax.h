// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SOFTMAX_H
#define SEMROVER_SOFTMAX_H
#include "shaders/lib/types.h"

struct SoftmaxPush {
    uint rows;
    uint cols;  // that count
    uint width; // columns of y that are written, a multiple of 8: zeros from `cols` on
    uint x_ld;  // elements
    uint y_ld;
    float scale; // of x, times log2(e)
};

#endif
