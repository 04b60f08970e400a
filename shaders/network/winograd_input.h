// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_WINOGRAD_INPUT_H
#define SEMROVER_WINOGRAD_INPUT_H
#include "shaders/lib/types.h"

struct WinogradInputPush {
    uint first_tile; // of the band
    uint tiles;      // of the band
    uint tiles_x;    // of an image
    uint image_tiles;
    uint image_rows;  // of x
    uint width;       // of x
    uint seen_height; // of the image that the taps see
    uint seen_width;
    uint shift; // 1: every pixel of x stands for two by two
    uint cols;  // channels, padded
    uint x_ld;  // elements
    uint v_ld;
};

#endif
