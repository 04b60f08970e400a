// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/grid.h"

namespace semrover {

// a grid's points in world coordinates, one array entry a point
struct ScenePoints {
    std::vector<std::array<float, 3>> positions; // metres
    std::vector<std::array<float, 3>> colors;    // sRGB, 0..1
    std::vector<uint32_t> labels;
    std::vector<uint32_t> cells;       // index of the voxel in the grid
    std::vector<uint32_t> owners = {}; // number of the thing that a point is of, 0 of none; empty: of none

    size_t size() const { return positions.size(); }
};

// points of the voxels that have them, of nothing
ScenePoints points_of(const VoxelGrid& grid);

// One point of each label and cube of the lattice whose cubes have edges of `edge` metres, at the mean place and with
// the mean colour of those in it: a voxel grid filter. Sorted by cube.
ScenePoints thinned(const ScenePoints& points, float edge);

// colours become those of the labels
void color_by_label(ScenePoints& points);

} // namespace semrover
