// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_GELU_H
#define SEMROVER_GELU_H
#include "shaders/lib/types.h"

struct GeluPush {
    uint rows;
    uint x_ld; // elements, a multiple of 8
    uint y_ld;
    uint width; // elements of a row that are worked on, a multiple of 8
};

#endif
