// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_ADD_H
#define SEMROVER_ADD_H
#include "shaders/lib/types.h"

struct AddPush {
    uint rows;
    uint cols;
    uint x_ld; // elements
    uint y_ld;
    uint residual_ld;
};

#endif
