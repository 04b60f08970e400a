// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/annotation/drive_record.h"
#include "engine/annotation/seen_objects.h"

namespace semrover {

constexpr const char* kBoxesName = "boxes.jsonl";

// What one picture shows
struct SeenPicture {
    DriveRecord::Picture picture;
    std::vector<SeenObject> objects;
};

// A line of boxes.jsonl (docs/formats.md §6.6), without its end. The same objects give the same bytes: lengths are
// rounded to 0.1 mm, quaternions and shares to 1e-6, places in pictures to 0.01 pixels
std::string box_line(const DriveRecord::Picture& picture, std::span<const SeenObject> objects,
                     const Rigid& world_to_vehicle, const Rigid& world_to_camera);

// bad_input with the line: a file is missing, or says what none of ours does
Result<std::vector<SeenPicture>> read_box_lines(const Path& file);

} // namespace semrover
