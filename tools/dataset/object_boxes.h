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

// Boxes of other programs' files, which become objects (docs/formats.md §3.1)
enum class BoxFormat : uint8_t { kitti, nuscenes, waymo, carla };
std::string_view name_of(BoxFormat format); // "kitti-boxes", ...
std::optional<BoxFormat> box_format_of(std::string_view name);
std::string names_of_box_formats(); // with commas between

// What a file is, if its name or its first 64 KiB leave no doubt: CARLA has no format of its own, and is never found.
std::optional<BoxFormat> detect_box_format(const Path& path);

struct BoxOptions {
    Path map = {};                      // of classes, see LabelMap; empty: the table alone
    Point3 origin{};                    // where the boxes' origin lies in the world, metres
    Path calibration = {};              // KITTI: boxes in the lidar's frame; empty: in the camera's place
    std::optional<uint64_t> frame = {}; // KITTI tracking: its number; Waymo's table: its timestamp, microseconds
    std::string sample = {};            // nuScenes: a token; empty: each instance once
    bool vehicle_frame = false;         // nuScenes, Waymo: of the sample or frame, instead of the world
};

struct BoxFile {
    std::vector<SceneObject> objects;
    std::vector<std::string> warnings; // what was left out
    uint64_t dropped = 0;              // objects
};

// Errors: bad_input with the line or the object; usage for options that the format has no place for
Result<BoxFile> read_box_file(const Path& path, BoxFormat format, const BoxOptions& options = {});

// the readers behind it; each has a table of classes
std::span<const SourceLabel> kitti_box_labels();
std::span<const SourceLabel> nuscenes_box_labels();
std::span<const SourceLabel> waymo_box_labels();
std::span<const SourceLabel> carla_box_labels();
Status read_kitti_boxes(const Path& path, const BoxOptions& options, BoxCollector& to);
Status read_nuscenes_boxes(const Path& path, const BoxOptions& options, BoxCollector& to);
Status read_waymo_boxes(const Path& path, const BoxOptions& options, BoxCollector& to);
Status read_carla_boxes(const Path& path, const BoxOptions& options, BoxCollector& to);

// how many words stand in front of the type of a KITTI label: 2 in tracking, else 0; none if the line is no label
std::optional<size_t> kitti_label_prefix(std::string_view line);
// the column that only Waymo's table of lidar boxes has
constexpr std::string_view kWaymoTableColumn = "[LiDARBoxComponent].box.center.x";

} // namespace semrover
