// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_GATED_ADD_H
#define SEMROVER_GATED_ADD_H
#include "shaders/lib/types.h"

struct GatedAddPush {
    uint rows; // of one group
    uint cols;
    uint groups;
    uint x_ld; // elements
    uint y_ld;
    uint residual_ld;
    uint gate_ld;
    uint gate_col;
    uint gate_step;
};

#endif
