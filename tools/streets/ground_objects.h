// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/conditioning/scene_objects.h"
#include "tools/streets/road_network.h"
#include "tools/trace/tracer.h"

namespace semrover {

// Appends pieces of what is paved alike, some ten metres long: of the lanes, of cycle lanes, of parking bays, of
// sidewalks, and of side streets. Without tints. Ids go on from those of `objects`.
void add_ground_objects(const RoadNetwork& road, std::vector<SceneObject>& objects);

// Gives pixels of ground the number of the piece of their class in which what they show lies deepest, its id + 1, by
// the rule of objects_of_cells. Where that is no piece they stay 0.
void number_ground(TracedImage& image, const CameraFrame& frame, std::span<const SceneObject> objects);

} // namespace semrover
