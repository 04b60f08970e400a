// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SPLIT_K_REDUCE_H
#define SEMROVER_SPLIT_K_REDUCE_H
#include "shaders/lib/types.h"

struct SplitKReducePush {
    uint rows; // of the output, all images, padding included
    uint cols; // N
    uint first_row;
    uint image_rows; // rows of an image
    uint x_ld;
    uint y_ld;
    uint y_col; // first column written, a multiple of 8
    uint bias_ld;
    uint residual_ld;
    uint shift_ld;
    uint shift_col;
    uint moments_ld;
    uint moments_pixels;
    uint moments_image_rows;
};

#endif
