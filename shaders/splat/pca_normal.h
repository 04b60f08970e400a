// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_PCA_NORMAL_H
#define SEMROVER_PCA_NORMAL_H
#include "shaders/lib/types.h"

struct PcaNormalPush {
    uint rows;        // points
    uint points_ld;   // floats from one point to the next
    uint neighbors;   // of a point
    uint line_labels; // bit per label: long and thin things
};

#endif
