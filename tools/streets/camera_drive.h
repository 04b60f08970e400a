// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tools/streets/road_network.h"
#include "tools/trajectory/camera_path.h"

namespace semrover {

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
