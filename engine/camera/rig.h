// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/camera.h"
#include "runtime/base/json.h"

#include <span>

namespace semrover {

// what the poses of a path are poses of
enum class PathAxes {
    camera,  // of a camera at the vehicle's origin that looks forward, OpenCV axes, like every path file here
    vehicle, // of the vehicle's own axes, which are the file's (CameraPath::body)
};

struct Rig {
    PathAxes path_axes = PathAxes::camera;
    std::vector<Sensor> sensors;
    std::vector<LidarSensor> lidars = {};
};

// rig.json:
//   {"path_axes": "camera" | "vehicle",                       default "camera"
//    "sensors": [{"name": "front",
//                 "model": "pinhole" | "opencv" | "fisheye" | "equirectangular" | "ftheta",    default "pinhole"
//                 "width": 616, "height": 424,
//                 "fov": 90 | "fx": .., "fy": .., "cx": .., "cy": ..,    fov: degrees across the width; none of them
//                                                                        for equirectangular, always the whole sphere,
//                                                                        and ftheta: engine/camera/ftheta_json.h
//                 "distortion": [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4],    opencv, 4, 5, 8 or 12 numbers;
//                                                                                    fisheye: k1 .. k4
//                 "shutter": {"direction": "down" | "up" | "right" | "left",     where lines go
//                             "start": -15000,                                   microseconds from the frame's time;
//                                                                                default 0
//                             "readout": 30000},                                 microseconds of all lines
//                 "sensor_to_vehicle": 4x4 | {"translation": [x, y, z], "rotation": [qx, qy, qz, qw]}},
//                {"name": "lidar_top", "lidar": "ot128",           of assets/lidar, or a file beside this one (.json),
//                                                            or such a table itself
//                 "sensor_to_vehicle": as above}]}
// The name of an only sensor may be "": its pictures are in no folder of their own. A key "comment" of text is allowed
// beside the others. bad_input for anything else, unknown keys included; at most 64 sensors, 16 MiB
Result<Rig> read_rig(const Path& path);
// folder: where the files of lidars are
Result<Rig> parse_rig(const Json& file, std::string_view where, const Path& folder = {});

// where a camera sits that is at the vehicle's origin and looks forward
constexpr Rigid kForwardCamera = {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 1};

Json matrix_json(const Rigid& pose); // 4x4

// the sensors as an object that read_rig reads; of lidars the tables
Json rig_json(std::span<const Sensor> sensors, std::span<const LidarSensor> lidars = {});

// The frames of all sensors at every pose of the vehicle: pose by pose, sensors in the rig's order; a sweep of each
// lidar ends there. Where the vehicle is during a sweep, and while a picture is read out, is interpolated between its
// poses; before the first and after the last one its motion goes on, and one with a single pose stands. Where times are
// numbers lidars stand, with a warning. bad_input for a shutter then, and where times do not rise
Result<CameraPath> expand_rig(const Rig& rig, const CameraPath& vehicle);

} // namespace semrover
