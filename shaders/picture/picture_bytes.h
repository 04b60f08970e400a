// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_PICTURE_BYTES_H
#define SEMROVER_PICTURE_BYTES_H
#include "shaders/lib/types.h"

struct PictureBytesPush {
    uint words;         // of y
    uint width, height; // of the picture
    uint x_width;       // pixels from one line of x to the next
    uint x_ld;
};

#endif
