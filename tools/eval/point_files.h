// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_points.h"
#include "runtime/base/file.h"

namespace semrover {

// points of anybody: lidar, reconstructions, splats' centres
struct PointCloud {
    std::vector<std::array<double, 3>> positions; // metres
    std::vector<std::array<float, 3>> colors;     // sRGB, 0..1; empty: none
    uint64_t dropped = 0;                         // that are not finite
};

// Whether a file is a PLY without faces. bad_input for a PLY that is broken
Result<bool> is_cloud(const Path& path);

// Vertices of a PLY: x y z and, where they are there, red green blue (8 bits, 16 bits if any is above 255, floats of 0
// to 1) or the colours of Gaussian splats (f_dc_0..2). bad_input: other colours, no points, a mesh with faces
Result<PointCloud> read_cloud(const Path& path);

// the points of a grid, or of a cloud (`dropped` counts those that are not finite); without labels. bad_input: as
// above, a grid without points, a cloud beyond 100 km, where floats are too coarse
struct PointFile {
    ScenePoints points; // colours are empty where a cloud has none
    uint64_t dropped = 0;
};
Result<PointFile> read_points(const Path& path);

} // namespace semrover
