// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_RESIZE_BILINEAR_H
#define SEMROVER_RESIZE_BILINEAR_H
#include "shaders/lib/types.h"

struct ResizeBilinearPush {
    uint rows; // of the output, all images, padding included
    uint first_row;
    uint in_height;
    uint in_width;
    uint in_words; // from one image to the next
    uint out_height;
    uint out_width;
    uint image_rows; // rows of an output image
    uint y_ld;
};

#endif
