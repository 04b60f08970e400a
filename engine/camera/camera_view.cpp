// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/camera_view.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

// p turned about an axis by a part of an angle (Rodrigues)
Point3 turned(const Point3& turn, double part, const Point3& p)
{
    const double whole = std::hypot(turn[0], turn[1], turn[2]);
    if (whole == 0)
        return p;
    const Point3 a = {turn[0] / whole, turn[1] / whole, turn[2] / whole};
    const Point3 b = {a[1] * p[2] - a[2] * p[1], a[2] * p[0] - a[0] * p[2], a[0] * p[1] - a[1] * p[0]};
    const Point3 c = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    const double angle = whole * part, half = std::sin(angle / 2);
    Point3 out;
    for (size_t i = 0; i < 3; ++i)
        out[i] = p[i] + std::sin(angle) * b[i] + 2 * half * half * c[i];
    return out;
}

// axis times radians of a rotation, the shorter way
Point3 turn_of(const Rigid& rotation)
{
    const auto [x, y, z, w] = quaternion_of(rotation);
    const double sine = std::hypot(x, y, z), scale = sine > 0 ? 2 * std::atan2(sine, w) / sine : 0;
    return {x * scale, y * scale, z * scale};
}

// part of a position, from -1/2 to 1/2 in the direction of the shutter
void set_lines(CameraMotion& m, ShutterDirection direction, const Intrinsics& k)
{
    const bool rows = direction == ShutterDirection::down || direction == ShutterDirection::up;
    const bool forward = direction == ShutterDirection::down || direction == ShutterDirection::right;
    m.across[rows ? 1 : 0] = (forward ? 1.0 : -1.0) / (rows ? k.height : k.width);
    m.first = forward ? -0.5 : 0.5;
}

} // namespace

Point3 CameraMotion::seen_at(double part, const Point3& p) const
{
    return turned(turn, -part, {p[0] - part * shift[0], p[1] - part * shift[1], p[2] - part * shift[2]});
}

Point3 CameraMotion::still(double part, const Point3& direction) const
{
    return turned(turn, part, direction);
}

CameraMotion motion_of(const CameraFrame& frame)
{
    if (!frame.moves())
        return {.middle = frame.readout ? frame.readout->from : frame.pose};
    const Rigid from = frame.readout->from.camera_to_world(), to = frame.readout->to.camera_to_world();
    CameraMotion m{.middle = {inverse(interpolate(from, to, 0.5))}};
    m.turn = turn_of(compose(inverse(from), to));
    const Rigid& view = m.middle.world_to_camera;
    for (size_t row = 0; row < 3; ++row)
        for (size_t i = 0; i < 3; ++i)
            m.shift[row] += view[4 * row + i] * (to[4 * i + 3] - from[4 * i + 3]);
    set_lines(m, frame.readout->direction, frame.intrinsics);
    return m;
}

CameraView::CameraView(const CameraFrame& frame)
    : lens_(frame.intrinsics), motion_(motion_of(frame)), to_world_(motion_.middle.camera_to_world())
{
}

// the line that shows a point when it is read: secants from a guess of its part. Lines before the first and after the
// last are read with those.
std::optional<Projection> CameraView::settle(double part, const Point3& still) const
{
    double before = part, off_before = 0;
    for (int i = 0; i < 40; ++i) {
        const std::optional<Projection> at = lens_.project(motion_.seen_at(part, still));
        if (!at)
            return {};
        const double off = std::clamp(part_of(at->x, at->y), -0.5, 0.5) - part;
        if (std::abs(off) < 1e-12)
            return at;
        double slope = i == 0 ? -1 : (off - off_before) / (part - before);
        if (!(std::abs(slope) > 0.02))
            slope = -1;
        before = part;
        off_before = off;
        part = std::clamp(part - off / slope, -0.5, 0.5);
        if (part == before)
            return std::abs(off) < 1e-9 ? at : std::nullopt;
    }
    return {};
}

std::optional<Projection> CameraView::project(const Point3& world) const
{
    const Point3 still = transform(motion_.middle.world_to_camera, world);
    if (!motion_.moves())
        return lens_.project(still);
    for (const double guess : {0.0, -0.5, 0.5})
        if (const auto found = settle(guess, still))
            return found;
    return {};
}

std::optional<Point3> CameraView::surface(double x, double y, double depth) const
{
    const std::optional<Point3> ray = lens_.ray(x, y);
    if (!ray || !(lens_.depth(*ray) > 0))
        return {};
    const double far = depth / lens_.depth(*ray), part = motion_.moves() ? part_of(x, y) : 0;
    Point3 at = motion_.still(part, {(*ray)[0] * far, (*ray)[1] * far, (*ray)[2] * far});
    for (size_t i = 0; i < 3; ++i)
        at[i] += part * motion_.shift[i];
    return transform(to_world_, at);
}

std::optional<Point3> CameraView::direction(double x, double y) const
{
    const std::optional<Point3> ray = lens_.ray(x, y);
    if (!ray)
        return {};
    const Point3 d = motion_.moves() ? motion_.still(part_of(x, y), *ray) : *ray;
    Point3 world;
    for (size_t row = 0; row < 3; ++row)
        world[row] = to_world_[4 * row] * d[0] + to_world_[4 * row + 1] * d[1] + to_world_[4 * row + 2] * d[2];
    return world;
}

std::optional<Projection> project(const CameraFrame& frame, const Point3& world)
{
    return CameraView(frame).project(world);
}

} // namespace semrover
