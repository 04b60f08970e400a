// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/camera_drive.h"

#include <algorithm>

namespace semrover {

namespace {

constexpr double kAhead = 9; // metres

// camera to world, OpenCV axes: x right, y down, z forward
Rigid look(const Vector3& from, const Vector3& forward)
{
    const Vector3 z = normalized(forward), x = normalized(cross(z, {0, 0, 1})), y = cross(z, x);
    return {x.x, y.x, z.x, from.x, x.y, y.y, z.y, from.y, x.z, y.z, z.z, from.z, 0, 0, 0, 1};
}

} // namespace

CameraPath drive_along(const RoadNetwork& road, const DriveShape& d, const Intrinsics& intrinsics)
{
    CameraPath path;
    const double lane = -road.section().lane / 2 + d.offset;
    const double last = std::max(d.first, road.length() - d.end_margin);
    for (int i = 0; d.first + i * d.spacing <= last; ++i) {
        const double s = d.first + i * d.spacing;
        const Vector3 from = road.at(s, lane, d.height), to = road.at(s + kAhead, lane, d.height);
        Vector3 forward = to - from;
        forward = Frame{{}}.turned(d.yaw).at(forward);
        forward.z *= 0.5; // half of the slope: cars pitch less than the road far ahead
        path.frames.push_back({.time = i * d.spacing / d.speed,
                               .camera = "",
                               .pose = {inverse(look(from, forward))},
                               .intrinsics = intrinsics});
    }
    return path;
}

} // namespace semrover
