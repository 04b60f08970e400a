// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_GEMM_H
#define SEMROVER_GEMM_H
#include "shaders/lib/types.h"

struct GemmPush {
    uint rows;  // M, of one group
    uint cols;  // N, of one group
    uint depth; // K, padded: the padding of x and w is zero
    uint first_row;
    uint x_ld; // elements
    uint w_ld;
    uint y_ld;
    uint y_col;   // first column written, a multiple of 8
    uint bias_ld; // from one group's bias to the next
    uint residual_ld;
    uint gate_ld;
    uint gate_col;  // first column of group 0 in the gate's rows
    uint gate_step; // columns from one group's gates to the next
    uint moments_ld;
    uint moments_pixels;     // rows of an image that count
    uint moments_image_rows; // rows of an image
    uint col_lanes;          // CPU variant: lanes side by side, set by the plan
};

#endif
