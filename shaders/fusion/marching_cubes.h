// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_MARCHING_CUBES_H
#define SEMROVER_MARCHING_CUBES_H
#include "shaders/lib/types.h"

struct MarchingCubesPush {
    uint rows;                         // blocks, or voxels of all blocks
    uint blocks_x, blocks_y, blocks_z; // of the box
    uint min_views;                    // a cell whose corners were all seen by fewer frames makes no surface
    float max_jump;                    // between the corners of a cell, in truncations
    uint first_row;                    // first block of those that are written
    uint first_vertex, first_face;     // of that block
};

#endif
