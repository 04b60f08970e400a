// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/scene/scene_points.h"
#include "tools/eval/pointnet_config.h"

namespace semrover {

// columns of a grid as sets of equally many points, for a network of points
struct PointChunks {
    uint32_t count = 0, points = 0, width = 0;
    std::vector<float> positions; // [count * points, 4] xyz as PointnetConfig::Input::xyz, 0
    std::vector<float> inputs;    // [count * points, width]
    uint32_t left_out = 0;        // chunks with fewer than min_points
};

// Chunk (i, j) holds the points with floor(x / chunk) = i, floor(y / chunk) = j; chunks come in that order. Of more
// than config.points, that many are drawn; fewer are repeated from the start. Points are in a random order that depends
// on the seed and their number in the grid only, since a ball takes the first ones it meets. bad_input when a point is
// not finite or 2^30 chunks away.
Result<PointChunks> cut_chunks(const ScenePoints& scene, const PointnetConfig& config, uint64_t seed = 0);

} // namespace semrover
