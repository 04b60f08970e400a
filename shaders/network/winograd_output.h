// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_WINOGRAD_OUTPUT_H
#define SEMROVER_WINOGRAD_OUTPUT_H
#include "shaders/lib/types.h"

struct WinogradOutputPush {
    uint first_tile; // of the band
    uint tiles;      // of the band
    uint tiles_x;    // of an image
    uint image_tiles;
    uint image_rows; // of y
    uint height;
    uint width;
    uint cols;    // channels, padded
    uint outputs; // channels
    uint m_ld; // elements
    uint y_ld;
    uint shift_ld;
    uint shift_col;
    uint residual_ld;
};

#endif
