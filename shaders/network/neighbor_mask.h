// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_NEIGHBOR_MASK_H
#define SEMROVER_NEIGHBOR_MASK_H
#include "shaders/lib/types.h"

struct NeighborMaskPush {
    uint rows;
    uint words;    // of a row of the mask
    int radius2;   // largest squared distance, in cells
    uint near_row; // rows from here on have near_radius2
    int near_radius2;
};

#endif
