// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/annotation/projected_box.h"
#include "engine/conditioning/scene_objects.h"

namespace semrover {

// A thing that stands or moves, at one time
struct PlacedObject {
    uint32_t id = 0;
    uint8_t label = 0;
    PlacedBox box; // in the world's frame
};
PlacedObject placed(const SceneObject& object);

// what a picture shows of it
struct SeenObject : PlacedObject {
    uint32_t pixels = 0;   // that show it
    PictureBox visible;    // around these pixels: whole numbers
    PictureBox amodal;     // around all of its box, which may reach beyond the picture
    double truncation = 0; // share of `amodal` that lies outside the picture
    double occlusion = 0;  // share of its outline in the picture that nearer things hide
};

// a picture of a camera, row-major
struct InstancePicture {
    uint32_t width = 0, height = 0;
    std::span<const uint32_t> numbers;         // of instances: id + 1, 0 for none
    std::function<double(size_t pixel)> depth; // metres, as Lens::depth has them; 0 for nothing
};

// The objects that have a pixel, by id, and numbers that no object has left out. Occlusion is estimated: of the pixels
// whose rays meet the object's box, V show it; O show what is nearer than its middle, and E anything else. Where
// nothing is in front, V / (V + E) of the box is filled, and so as much of O is taken for the object's:
//   f = (V + 8 * 0.7) / (V + E + 8), occlusion = f O / (V + f O)
// docs/method.md §5.7 says how far that is from outlines that are drawn alone.
std::vector<SeenObject> seen_objects(const CameraFrame& frame, const InstancePicture& picture,
                                     std::span<const PlacedObject> objects);

} // namespace semrover
