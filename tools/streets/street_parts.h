// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "tools/streets/mesh_builder.h"
#include "tools/streets/moving.h"
#include "tools/streets/road_network.h"

#include <map>
#include <string>

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

// where the parts of a street go, and the count of what was put there
struct Site {
    MeshBuilder& mesh;
    const RoadNetwork& road;
    uint64_t seed;
    std::map<std::string, size_t>& objects;
    std::vector<MovingThing>& moving;
};

// houses, gardens and parks on both sides of the blocks, along the side streets, and what closes the view at their
// ends; lawns and soil where nothing is built
void add_plots(Site& site);

// what stands on the sidewalks: trees, lights, signs, bins, benches, bicycles in racks, bus stops, people
void add_furnishing(Site& site);
// what stands on the carriageway: parked and waiting vehicles, two-wheelers with riders, a tram where there are rails
void add_traffic(Site& site);

} // namespace semrover
