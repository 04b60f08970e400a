// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "tools/streets/road_network.h"

namespace semrover {

// Appends pieces of what is paved alike, some ten metres long: of the lanes, of cycle lanes, of parking bays, of
// sidewalks, and of side streets. Without tints. Ids go on from those of `objects`.
void add_ground_objects(const RoadNetwork& road, std::vector<SceneObject>& objects);

} // namespace semrover
