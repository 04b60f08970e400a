// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

namespace semrover {

// differences of colour from one voxel to the next, 0..255: the mean over the channels of |mean colour of a voxel's
// points
// - that of its neighbour's|
struct ColorSteps {
    size_t pairs = 0;
    double sum = 0, squares = 0;

    void add(double step)
    {
        ++pairs;
        sum += step;
        squares += step * step;
    }
    double mean() const { return pairs ? sum / double(pairs) : 0; }
    double deviation() const; // of one pair from the mean
};

struct SeamSteps {
    ColorSteps across, inside; // of pairs over the border of two tiles, of those within a tile
};

// Of all pairs of neighbours along i and j that have points and one label; `edge`: voxels of a tile's edge
SeamSteps seam_steps(const VoxelGrid& grid, int32_t edge);

} // namespace semrover
