// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_RELU_H
#define SEMROVER_RELU_H
#include "shaders/lib/types.h"

struct ReluPush {
    uint rows;
    uint x_ld; // elements, a multiple of 8
    uint y_ld;
    uint y_col; // first column written, a multiple of 8
    uint width; // elements of a row that are worked on, a multiple of 8
};

#endif
