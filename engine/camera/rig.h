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
    std::vector<LidarSensor> lidars;
};

// rig.json:
//   {"path_axes": "camera" | "vehicle",                       default "camera"
//    "sensors": [{"name": "front",
//                 "model": "pinhole" | "opencv" | "fisheye" | "equirectangular",    default "pinhole"
//                 "width": 616, "height": 424,
//                 "fov": 90 | "fx": .., "fy": .., "cx": .., "cy": ..,    fov: degrees across the width; none of them
//                                                                        for equirectangular, always the whole sphere
//                 "distortion": [k1, k2, p1, p2, k3, k4, k5, k6],        opencv, 4, 5 or 8 numbers; fisheye: k1 .. k4
//                 "sensor_to_vehicle": 4x4 | {"translation": [x, y, z], "rotation": [qx, qy, qz, qw]}},
//                {"name": "lidar_top", "lidar": "ot128",           of assets/lidar, or a file beside this one (.json)
//                 "sensor_to_vehicle": as above}]}
// A key "comment" of text is allowed beside the others. bad_input for anything else, unknown keys included; at most 64
// sensors, 16 MiB
Result<Rig> read_rig(const Path& path);

// the sensors as an object that read_rig reads
Json rig_json(std::span<const Sensor> sensors);

// the frames of all sensors at every pose of the vehicle: pose by pose, sensors in the rig's order; a sweep of each
// lidar ends there
CameraPath expand_rig(const Rig& rig, const CameraPath& vehicle);

} // namespace semrover
