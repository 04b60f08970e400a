// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/annotation/box_lines.h"
#include "engine/format/image.h"
#include "engine/shards/shard_set.h"
#include "tools/export/lidar_scans.h"

#include <map>

namespace semrover {

// A thing that pictures of a drive show, over time
struct Track {
    struct Place {
        size_t moment = 0; // of DriveRecord::moments
        Rigid pose = kIdentity;
        double shown = 0; // of its outline, the largest share that a camera shows
    };
    uint32_t id = 0;
    uint8_t label = 0;
    std::array<double, 3> size{};
    std::vector<Place> places; // ascending

    bool moves() const; // anywhere on the way by more than 5 cm or 0.6 degrees
};

// What is exported: a folder that `render` or `refine` wrote, or a shard set of one
struct DriveInput {
    Path folder;
    std::string name; // of the folder: letters, digits, '_' and '-'
    ShardsOrNone shards;
    DriveRecord record;
    CameraPath path;                             // of it, a frame a picture
    std::vector<SeenPicture> boxes;              // one a picture, or none at all
    std::vector<std::vector<size_t>> of_moments; // pictures of each moment
    LidarScans lidar;

    // a frame that was refined, or else what splats look like; bad_input: it is not there
    Result<Path> color(size_t picture) const;
    // "depth", "label" or "instance"; none where there is none. bad_input: there are two
    Result<std::optional<Path>> other(size_t picture, const char* kind) const;

    std::vector<Track> tracks() const;                    // by id
    double speed(const Track& track, size_t place) const; // m/s, from one place to the next; 0 of an only one
    Result<ImageRgb8> read_color(size_t picture) const;
};

// bad_input as the readers say, and for boxes that are not of the drive's pictures
Result<DriveInput> open_drive(const Path& folder);

} // namespace semrover
