// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_KNN_H
#define SEMROVER_KNN_H
#include "shaders/lib/types.h"

struct KnnPush {
    uint rows;           // points
    uint points_ld;      // floats from one point to the next
    uint mask;           // buckets - 1, buckets a power of two
    float cell_size;     // of the grid
    float per_metre;     // 1 / cell_size
    float radius2;       // square of the largest distance of a neighbour
    uint queries;        // points whose neighbours are sought, if they are others
    uint queries_ld;
    uint min_same_label; // fewer neighbours of the same label than this: neighbours of any label
};

#endif
