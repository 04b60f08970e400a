// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_POINT_GROUPS_H
#define SEMROVER_POINT_GROUPS_H
#include "shaders/lib/types.h"

struct FarthestPointPush {
    uint count;   // points of a set
    uint samples; // of a set, to choose
    uint first;   // of the samples, those of this dispatch
    uint end;
};

struct BallQueryPush {
    uint rows;    // centers of all sets
    uint count;   // points of a set
    uint samples; // centers of a set
    uint neighbors;
    float radius2;
};

struct GroupPointsPush {
    uint rows; // members of all groups
    uint first_row;
    uint neighbors; // members of a group
    uint features;  // columns
    uint features_ld;
    uint y_ld;
};

#endif
