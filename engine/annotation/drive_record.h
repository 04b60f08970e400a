// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/rig.h"

namespace semrover {

// What a drive's output says of its cameras and times, beside its pictures:
//   calibration.json   the sensors as a rig.json has them, the unit of depth, and what units and axes there are
//   ego_pose.jsonl     {"time": 1500000, "position": [x, y, z], "rotation": [qx, qy, qz, qw]}, a line a moment
//   timestamps.jsonl   {"time": 1500000, "camera": "front", "number": 15}, a line a picture
// Times are microseconds. The vehicle's axes are x forward, y left, z up; poses are to the world (docs/formats.md §6.5)
struct DriveRecord {
    struct Moment {
        int64_t time = 0;
        Rigid vehicle_to_world = kIdentity;
    };
    struct Picture {
        int64_t time = 0; // that of a moment
        std::string camera;
        uint32_t number = 0; // of the camera's pictures
    };

    double depth_unit = 0.001;            // metres of what depth pictures hold
    std::vector<Sensor> sensors;          // as they were drawn; one may have no name
    std::vector<LidarSensor> lidars = {}; // whose sweeps lie in folders of their own
    std::vector<Moment> moments;          // ascending
    std::vector<Picture> pictures;        // in the path's order, ascending for each camera

    const Sensor* sensor(std::string_view name) const; // nullptr: there is none
    const Moment* moment(int64_t time) const;
};

// Of a path through a rig, or of cameras without one: the vehicle then is where the first camera of a moment is, and
// looks where it looks. bad_input for what such a record cannot hold: times that do not ascend, cameras that change
// their lens or their place on the vehicle
Result<DriveRecord> drive_record_of(const CameraPath& path, double depth_unit);

constexpr const char* kDriveRecordFiles[] = {"calibration.json", "ego_pose.jsonl", "timestamps.jsonl"};
Status write_drive_record(const Path& folder, const DriveRecord& record);
// bad_input: a file is missing, or says what no record of ours does
Result<DriveRecord> read_drive_record(const Path& folder);

// the path that a record is of: poses to 1e-12
CameraPath path_of(const DriveRecord& record);

} // namespace semrover
