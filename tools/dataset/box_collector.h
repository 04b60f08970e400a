// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rigid.h"
#include "engine/conditioning/scene_objects.h"
#include "engine/format/label_map.h"

#include <set>

namespace semrover {

// a box as another program's file has it
struct ForeignBox {
    std::string_view label;          // what the file calls its class
    Rigid pose;                      // of the box's axes (x ahead, y left, z up) in a frame whose z is up
    Point3 size;                     // along the box's axes, metres
    std::optional<uint64_t> id = {}; // in the file
    std::optional<std::array<double, 3>> tint = {};
};

// Makes objects of boxes: their classes by a table or a map, and upright boxes of turned ones.
class BoxCollector {
  public:
    // A file with entries of `map` (empty: none) overrides the table. Errors: bad_input, as LabelMap::apply, but names
    // that the table lacks are taken
    static Result<BoxCollector> create(std::span<const SourceLabel> table, const Path& map, const Point3& origin);

    // Leaves out boxes of classes that have no place here, and those whose z axis is more than 45 degrees from the
    // vertical. The heading is where the box's x axis points, seen from above; what it is tilted is dropped.
    // Errors: bad_input, with `where` in front, as check_object, and for more than kMaxObjects
    Status add(const ForeignBox& box, std::string_view where);

    // The ids are those of the file where every box has one below 2^32, else they count from 0. Errors: bad_input for
    // unknown classes, with counts, and for ids given twice
    Result<std::vector<SceneObject>> finish(std::string_view where);
    std::vector<std::string> warnings() const;
    uint64_t dropped() const { return labels_.dropped() + tilted_; }

  private:
    uint32_t number_of(std::string_view label);

    LabelMap labels_;
    std::map<std::string, uint32_t, std::less<>> numbers_; // of names
    Point3 origin_{};
    std::vector<SceneObject> objects_;
    std::set<uint64_t> ids_;
    uint64_t tilted_ = 0;
    std::string repeated_; // where an id appears again
    bool all_have_ids_ = true;
};

} // namespace semrover
