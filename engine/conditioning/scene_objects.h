// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "runtime/base/json.h"

#include <array>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

namespace semrover {

// A thing of one class in an upright box. Metres in the world's frame; the heading is where its front looks, radians
// from x towards y.
struct SceneObject {
    uint32_t id = 0;   // unique in a scene
    uint8_t label = 0; // < kClassCount
    std::array<double, 3> center{};
    std::array<double, 3> size{}; // along the heading, across it, up
    double heading = 0;
    std::optional<std::array<double, 3>> tint = {}; // its colour, sRGB 0..1
    bool part = false;                              // of an object of its class: a window of a house. Owns no voxels
};

// from the axes of its box (along the heading, to the left, up, from its middle) to the world
Rigid box_to_world(const SceneObject& object);

constexpr size_t kMaxObjects = 1 << 20;

// by id; they outlive it
using ObjectsById = std::unordered_map<uint32_t, const SceneObject*>;
ObjectsById by_id(std::span<const SceneObject> objects);

// "#7a1f1c" -> sRGB 0..1. Errors: bad_input, with `where` in front
Result<std::array<double, 3>> parse_tint(std::string_view text, std::string_view where);
std::string tint_text(const std::array<double, 3>& tint); // "#7a1f1c", each channel rounded to 8 bits

// Files of objects (docs/formats.md §2.8). The writer rounds (as_written) lengths to 0.1 mm; the same objects give the
// same bytes. Errors: bad_input with the number of the object, for unknown keys and classes, ids given twice, boxes
// beyond 1000 km or without size, colours outside 0..1.
Result<std::vector<SceneObject>> parse_objects(const Json& json, std::string_view where);
Result<std::vector<SceneObject>> read_objects(const Path& path);
// bad_input, with `where` in front, for a box beyond 1000 km, without size or longer than 10 km, and for what is not
// finite: what a file of objects cannot hold
Status check_object(const SceneObject& object, std::string_view where);
// "street.sgrid" -> "street.objects.json": where generate writes, and edit and inpaint look for, a grid's objects
Path objects_beside(const Path& grid);
SceneObject as_written(SceneObject object);
Status write_objects(const Path& path, std::span<const SceneObject> objects);

} // namespace semrover
