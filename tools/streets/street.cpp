// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/streets/street.h"

#include "engine/scene/palette.h"
#include "tools/streets/ground_objects.h"
#include "tools/streets/street_parts.h"

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

Street make_street(const StreetOptions& options)
{
    Street street{RoadNetwork(options.seed, options.length), {}, {}, {}, {}, {}, {}};
    MeshBuilder mesh;
    Site site{mesh, street.road, options.seed, street.objects, street.moving};
    add_road_surface(mesh, street.road, options.seed);
    add_plots(site);
    add_furnishing(site);
    add_traffic(site);
    street.gloss = mesh.gloss();
    street.boxes = std::move(mesh.objects());
    street.owners = mesh.owners();
    add_ground_objects(street.road, street.boxes);
    street.mesh = std::move(mesh).take();
    return street;
}

std::vector<ClassShare> class_shares(const Mesh& mesh)
{
    std::vector<ClassShare> shares(kClassCount);
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto at = [&](size_t corner) {
            const auto& p = mesh.positions[mesh.faces[f][corner]];
            return Vector3{p[0], p[1], p[2]};
        };
        ClassShare& share = shares[mesh.face_labels[f]];
        ++share.faces;
        share.area += length(cross(at(1) - at(0), at(2) - at(0))) / 2;
    }
    return shares;
}

} // namespace semrover
