// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_BLOCK_SHARES_H
#define SEMROVER_BLOCK_SHARES_H
#include "shaders/lib/types.h"

struct BlockSharesPush {
    uint rows;          // of y
    uint width, height; // of the picture
    uint block;         // pixels on a side
    uint y_width, y_height;
};

#endif
