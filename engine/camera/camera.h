// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/lidar.h"
#include "runtime/base/file.h"
#include "runtime/base/result.h"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace semrover {

// the one convention inside: OpenCV camera axes (x right, y down, z forward), world to camera, metres, double; pixel
// (column c, row r) covers [c, c+1) x [r, r+1), its centre is at (c + 0.5, r + 0.5)
// how a ray becomes a pixel; the formulas are in engine/camera/lens.h
enum class CameraModel : uint8_t { pinhole, opencv, fisheye, equirectangular, ftheta };

// opencv: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, in OpenCV's order; fisheye: k1 k2 k3 k4; ftheta: p1 p2 p3 p4 p5 of the
// reference polynomial, c d e, max_angle in radians, 1 where the polynomial is from pixels to angles, else 0
using Distortion = std::array<double, 12>;

struct Intrinsics {
    double fx = 0, fy = 0; // pixels; equirectangular: pixels a radian; ftheta: 1, times what the picture was scaled by
    double cx = 0, cy = 0; // pixels from the top left corner of the image
    uint32_t width = 0, height = 0;
    CameraModel model = CameraModel::pinhole;
    Distortion distortion{};

    bool operator==(const Intrinsics&) const = default;
};

struct Pose {
    Rigid world_to_camera = kIdentity;

    Rigid camera_to_world() const { return inverse(world_to_camera); }
};

// where the first line of a picture is that is read out, and so which way the others follow: rows from the top down or
// from the bottom up, columns from left to right or from right to left
enum class ShutterDirection : uint8_t { down, up, right, left };

// A rolling shutter: a picture is read out line by line. Line i of n, as they are read, is seen (i + 0.5) / n of the
// readout after its start.
struct Shutter {
    ShutterDirection direction = ShutterDirection::down;
    int64_t start = 0;   // microseconds, from the frame's time to the start of the readout
    int64_t readout = 0; // of all lines, microseconds

    bool operator==(const Shutter&) const = default;
};

// a camera's poses at the start and at the end of its readout
struct Readout {
    ShutterDirection direction = ShutterDirection::down;
    Pose from = {}, to = {};
    double start = 0, end = 0; // seconds from the frame's time; both 0 where that is not known

    // the same pose, to the bit, sees what a global shutter sees
    bool moves() const { return from.world_to_camera != to.world_to_camera; }
};

struct CameraFrame {
    double time = 0;    // seconds
    std::string camera; // name of the sensor; empty when there is one without a name
    Pose pose;          // at that time
    Intrinsics intrinsics;
    std::string picture = {};            // what a path calls its picture, with folders; empty: the path names none
    std::optional<Readout> readout = {}; // of a rolling shutter: the picture is seen from these

    bool moves() const { return readout && readout->moves(); } // while it is read out
};

// what the poses of a file are of, where it is not a camera
struct PathBody {
    std::string name;             // "a vehicle (x forward, y left, z up)"
    Rigid forward_camera_to_body; // a camera at its origin that looks forward
};

// A camera of a rig. Vehicle axes: x forward, y left, z up; sensor axes are OpenCV's.
struct Sensor {
    std::string name; // is_camera_name, unique in the rig; an only one may have none
    Intrinsics intrinsics;
    Rigid sensor_to_vehicle = kIdentity;
    std::optional<Shutter> shutter = {}; // none: all lines are seen at the frame's time
};

// A lidar of a rig, in its own axes (engine/camera/lidar.h)
struct LidarSensor {
    std::string name; // as a camera's
    std::shared_ptr<const Lidar> lidar;
    Rigid sensor_to_vehicle = kIdentity;
};

// One turn of a lidar. It ends at a pose of the path.
struct LidarSweep {
    double time = 0; // of its end, seconds
    std::string sensor;
    std::shared_ptr<const Lidar> lidar;
    Rigid begin = kIdentity, end = kIdentity; // sensor to world

    Rigid at(uint32_t beam, uint32_t column) const; // when it is fired
};

// The frames that a run renders, in order. Readers return at least one. A file of a body's poses has frames of a camera
// at the body's origin that looks forward.
struct CameraPath {
    std::vector<CameraFrame> frames;
    std::vector<Sensor> sensors = {};       // of the rig that the frames are of, if they are of one
    std::vector<LidarSensor> lidars = {};   // likewise; a rig may have no others
    std::vector<LidarSweep> sweeps = {};    // pose by pose
    bool numbered = false;                  // the times are numbers that the file gives its frames
    std::optional<PathBody> body = {};      // of the file's poses; none: a camera
    std::vector<std::string> warnings = {}; // of the reader

    // a frame's pose to the world, in the axes of the file's own poses
    Rigid file_pose(size_t frame) const;
};

// the same view with another number of pixels
Intrinsics scaled_to(const Intrinsics& intrinsics, uint32_t width, uint32_t height);

// square pixels, centred; the field of view across the width, in degrees, above 0 and below 180
Intrinsics pinhole_from_fov(double horizontal_degrees, uint32_t width, uint32_t height);
// the same for an equidistant fisheye: distance from the centre = focal length times angle; above 0, at most 360
Intrinsics fisheye_from_fov(double horizontal_degrees, uint32_t width, uint32_t height);
// the whole sphere: 360 degrees across the width, 180 across the height, forward in the middle
Intrinsics whole_sphere(uint32_t width, uint32_t height);

// a lens without distortion is a pinhole, for which there is a faster renderer
Intrinsics simplified(Intrinsics intrinsics);

// bad_input unless sizes are 1..16384, focal lengths finite and above 0, the centre finite, the distortion finite and
// of a model that has one, a panorama the whole sphere
Status check_intrinsics(const Intrinsics& intrinsics, std::string_view where);

std::string_view name_of(CameraModel model);
std::optional<CameraModel> camera_model_of(std::string_view name);

std::string_view name_of(ShutterDirection direction);
std::optional<ShutterDirection> shutter_direction_of(std::string_view name);

int64_t microseconds_of(double seconds); // rounded: a time of a frame as files of times have it

struct Projection {
    double x, y;  // pixels
    double depth; // metres along z; equirectangular: from the camera
};

// a name that can be a folder: 1 to 64 of [A-Za-z0-9._-], not starting with a dot
bool is_camera_name(std::string_view name);

} // namespace semrover
