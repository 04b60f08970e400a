// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_ROW_NORM_H
#define SEMROVER_ROW_NORM_H
#include "shaders/lib/types.h"

struct RowNormPush {
    uint rows; // of one group
    uint cols;
    uint groups;
    uint x_ld; // elements
    uint y_ld;
    uint table_ld;
    uint shift_col; // first column of group 0's shift in the table
    uint scale_col;
    uint step; // columns from one group's to the next
    float eps;
};

#endif
