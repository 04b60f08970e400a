// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_HEAD_RMS_NORM_H
#define SEMROVER_HEAD_RMS_NORM_H
#include "shaders/lib/types.h"

struct HeadRmsNormPush {
    uint rows; // of one group
    uint groups;
    uint heads;
    uint head_dim; // a multiple of 8
    uint x_ld;     // elements
    uint y_ld;
    uint weight_ld;
    float eps;
};

#endif
