// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_CONV2D_H
#define SEMROVER_CONV2D_H
#include "shaders/lib/types.h"

struct Conv2dPush {
    uint rows; // of the output, all images, padding included
    uint cols; // N
    uint first_row;
    uint x_first; // rows of x in front of the one that is bound first
    uint x2_first;
    uint out_width;
    uint out_pixels; // of an image
    uint image_rows; // rows of an output image
    uint in_width;   // of x as stored
    uint in_image_rows;
    uint seen_width; // of x after upsampling
    uint seen_height;
    uint stride;
    uint padding_y; // above
    uint padding_x; // to the left
    uint shift;     // 1: nearest x2
    uint x_ld;
    uint x2_ld;
    uint x_cols; // padded
    uint x2_cols;
    uint w_ld;
    uint y_ld;
    uint y_col; // first column written, a multiple of 8
    uint bias_ld;
    uint residual_ld;
    uint shift_ld;
    uint shift_col;
    uint moments_ld;
    uint moments_pixels;
    uint moments_image_rows;
    uint col_lanes; // CPU variant: lanes side by side, set by the plan
};

#endif
