// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/mesh_builder.h"
#include "tools/streets/road_network.h"

namespace semrover {

constexpr double kParkingBay = 5.6; // length of a bay, metres

// where pedestrians cross the carriageway, along the street
struct Crossing {
    double first, last;
    const Junction* junction;
    bool before; // the junction, in the direction of the street
};
std::vector<Crossing> crossings_of(const RoadNetwork& road);

// carriageway with markings, kerbs (lowered at crossings), sidewalks, side streets
void add_road_surface(MeshBuilder& mesh, const RoadNetwork& road, uint64_t seed);

} // namespace semrover
