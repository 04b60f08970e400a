// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/mesh_builder.h"
#include "tools/streets/road_network.h"

#include <map>
#include <string>

namespace semrover {

// where the parts of a street go, and the count of what was put there
struct Site {
    MeshBuilder& mesh;
    const RoadNetwork& road;
    uint64_t seed;
    std::map<std::string, size_t>& objects;
};

// houses, gardens and parks on both sides of the blocks, along the side streets, and what closes the view at their
// ends; lawns and soil where nothing is built
void add_plots(Site& site);

} // namespace semrover
