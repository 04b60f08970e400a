// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "engine/mesh/mesh.h"
#include "engine/scene/grid.h"
#include "tools/streets/moving.h"
#include "tools/streets/road_network.h"
#include "tools/trajectory/camera_path.h"

#include <map>
#include <string>

namespace semrover {

struct StreetOptions {
    uint64_t seed = 0;
    double length = 120; // metres, 30..20000
};

// A street that was made up: the world's origin is where its centre line begins, x along it.
struct Street {
    RoadNetwork road;
    Mesh mesh;                             // every face has a label and a textured material
    std::vector<float> gloss;              // of each material, 0..1 (engine/trace)
    std::map<std::string, size_t> objects; // how many of each kind stand in it
    std::vector<SceneObject> boxes;        // of vehicles, houses, trees, pieces of ground, ..., without tints; by id
    std::vector<uint32_t> owners;          // of each face the id of the object that it is of + 1; 0: none, or ground
    std::vector<MovingThing> moving;       // what could move
};

// The same seed gives the same street on every run; a longer one begins like a shorter one, as far as 60 m before the
// shorter one's end. Objects never share random numbers.
Street make_street(const StreetOptions& options);

// faces and square metres of each class
struct ClassShare {
    size_t faces = 0;
    double area = 0;
};
std::vector<ClassShare> class_shares(const Mesh& mesh); // [kClassCount]

struct DriveShape {
    double spacing = 2;     // metres between frames
    double height = 1.7;    // of the camera over the road
    double offset = 0;      // metres to the left of the right lane's middle
    double yaw = 0;         // radians to the left of the street's direction
    double first = 6;       // where it begins, along the street
    double end_margin = 34; // how far before the end it stops
    double speed = 8;       // metres a second, for the times
};

// a camera along the right lane: level, looking along the street a little way ahead, so that it turns softly
CameraPath drive_along(const RoadNetwork& road, const DriveShape& shape, const Intrinsics& intrinsics);

} // namespace semrover
