// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_GROUP_NORM_H
#define SEMROVER_GROUP_NORM_H
#include "shaders/lib/types.h"

struct GroupNormMergePush {
    uint rows;     // of the result, of all images
    uint merged;   // rows of the result, of an image
    uint together; // chunks that become one
    uint pixels;   // of an image
    uint chunks;   // of 16 rows, of an image
    uint cols;
    uint moments_ld;
    uint merged_ld;
};

struct GroupNormScalePush {
    uint pixels;     // of an image
    uint chunks;     // of an image
    uint chunk_rows; // rows of a chunk
    uint images;     // whose statistics are taken together
    uint x_cols;
    uint x2_cols;
    uint moments_ld;
    uint moments2_ld;
    uint scale_ld;
    uint group_cols;
    float eps;
};

struct GroupNormApplyPush {
    uint rows;
    uint x_cols;
    uint x2_cols;
    uint first_row;
    uint image_rows; // of all images that have their statistics together
    uint x_ld;
    uint x2_ld;
    uint y_ld;
    uint scale_ld;
};

#endif
