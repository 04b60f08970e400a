// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/camera/lens.h"

namespace semrover {

// How a camera moves while its picture is read out. Parts run from -1/2 at the start to 1/2 at the end; the position is
// linear in them, the rotation even about one axis.
struct CameraMotion {
    Pose middle;                    // at part 0: its own frame there is the still frame
    Point3 turn{}, shift{};         // from start to end, of the still frame: axis times radians; metres
    std::array<double, 2> across{}; // a position (x, y) of the picture is read at the part
    double first = 0;               // across[0] x + across[1] y + first

    bool moves() const { return turn != Point3{} || shift != Point3{}; }
    // a point of the still frame in the camera's own at a part, and a direction of the latter in the still frame
    Point3 seen_at(double part, const Point3& still) const;
    Point3 still(double part, const Point3& direction) const;
};
// of a frame without a readout, or one in which the camera stands: it does not move
CameraMotion motion_of(const CameraFrame& frame);

// A camera in its place, which changes while its picture is read out: its pixels and the world
class CameraView {
  public:
    explicit CameraView(const CameraFrame& frame);

    // where a point of the world is in the picture. A camera that moves sees it in the line that is read when it is
    // there; of several such lines one is taken. Depth is that from the camera's place then. None where the lens does
    // not look, and where no line sees it
    std::optional<Projection> project(const Point3& world) const;

    // of the surface at a position of the picture, `depth` metres away (> 0); none where the lens does not look
    std::optional<Point3> surface(double x, double y, double depth) const;
    // unit, of the world
    std::optional<Point3> direction(double x, double y) const;

  private:
    std::optional<Projection> settle(double part, const Point3& still) const;
    double part_of(double x, double y) const { return motion_.across[0] * x + motion_.across[1] * y + motion_.first; }

    Lens lens_;
    CameraMotion motion_;
    Rigid to_world_; // of the still frame
};

std::optional<Projection> project(const CameraFrame& frame, const Point3& world);

// Where one camera saw what another sees
class Reprojection {
  public:
    Reprojection(const CameraFrame& from, const CameraFrame& to) : from_(from), to_(to) {}

    // the surface at a position (x, y) of the picture of `to`, `depth` metres away (> 0), as `from` saw it; none where
    // one of the lenses does not look
    std::optional<Projection> source(double x, double y, double depth) const
    {
        const std::optional<Point3> place = to_.surface(x, y, depth);
        return place ? from_.project(*place) : std::nullopt;
    }

  private:
    CameraView from_, to_;
};

} // namespace semrover
