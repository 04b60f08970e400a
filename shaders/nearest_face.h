// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_NEAREST_FACE_H
#define SEMROVER_NEAREST_FACE_H
#include "lib/types.h"

struct NearestFacePush {
    uint rows;                      // points
    uint cells_x, cells_y, cells_z; // of the search grid
    float low_x, low_y, low_z;      // its corner, metres
    float cell_size;                // metres
    float radius;                   // nothing further away is looked for, metres
};

#endif
