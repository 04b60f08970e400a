// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#ifndef SEMROVER_SPLAT_H
#define SEMROVER_SPLAT_H
#include "shaders/lib/types.h"

struct SplatPush {
    uint splats;
    uint cameras;
    uint width; // pixels, at most 65535
    uint height;
    uint tile; // pixels, a multiple of 16
    uint tiles_x;
    uint tiles_y;
    uint max_visible; // capacity in records
    uint max_pairs;   // capacity in pairs of a tile and a record
    float near;       // metres
    float alpha_min;  // contributions below are skipped
    float alpha_max;
    float transmittance_min; // a pixel is done before it falls below
    float cutoff2;           // square of the largest distance from the centre, in sigmas
    float filter_scale;      // 1 / variance of the screen filter in pixels^2
    uint movers;             // rows of the table of views, a camera
    uint mover_numbers;      // entries of the table of rows
};

// The table of a lidar's rows (engine/camera/lidar.h), by rising angle: angle below the horizon; of its rays from their
// column's, clockwise, both radians; what is added to a pixel's number for the column in which it is fired; how many
// columns after that one begins

#endif
