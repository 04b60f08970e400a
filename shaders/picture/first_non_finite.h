// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_FIRST_NON_FINITE_H
#define SEMROVER_FIRST_NON_FINITE_H
#include "shaders/lib/types.h"

struct FirstNonFinitePush {
    uint elements; // of the pixels that count
    uint cols;
    uint width;   // pixels of a line that count
    uint x_width; // pixels from one line to the next
    uint x_ld;
};

#endif
