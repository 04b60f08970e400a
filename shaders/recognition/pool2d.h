// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_POOL2D_H
#define SEMROVER_POOL2D_H
#include "shaders/lib/types.h"

struct Pool2dPush {
    uint rows; // of the output, all images, padding included
    uint first_row;
    uint x_first; // rows of x in front of the one that is bound first
    uint out_width;
    uint out_pixels; // of an image
    uint image_rows; // rows of an output image
    uint in_width;
    uint in_height;
    uint in_image_rows;
    uint kernel_height;
    uint kernel_width;
    uint stride_y;
    uint stride_x;
    uint padding_y; // above
    uint padding_x; // to the left
    uint x_ld;
    uint y_ld;
    uint y_col; // first column written, a multiple of 8
    uint width; // columns worked on, a multiple of 8
};

#endif
