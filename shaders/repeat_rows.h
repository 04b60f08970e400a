// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_REPEAT_ROWS_H
#define SEMROVER_REPEAT_ROWS_H
#include "lib/types.h"

struct RepeatRowsPush {
    uint rows; // of y
    uint cols;
    uint x_rows;
    uint x_ld; // elements
    uint y_ld;
};

#endif
