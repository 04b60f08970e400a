// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_TSDF_H
#define SEMROVER_TSDF_H
#include "shaders/lib/types.h"

struct TsdfPush {
    uint rows;   // pixels of the batch, words of the bitmap, or voxels
    uint frames; // rows of the table of frames
    uint blocks_x, blocks_y, blocks_z; // of the box
    float voxel;                       // metres
    float truncation;                  // metres
    float band;                        // metres from the surface within which a pixel votes and colours
    float max_depth;                   // metres
    float min_weight;                  // a voxel with less is unobserved
};

#endif
