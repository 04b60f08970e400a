// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/projected_box.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace semrover {

namespace {

constexpr int kSteps = 64;        // of an edge that a lens bends
constexpr int kHalvings = 40;     // to where an edge leaves what a lens sees
constexpr int kDirections = 1440; // around the limit of a lens
constexpr double kJustInside = 1 - 1e-9;

using Polygon = std::vector<Point3>;

Point3 between(const Point3& a, const Point3& b, double t)
{
    return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
}

// corner of a box by the bits of its number
Point3 corner(const PlacedBox& box, unsigned number)
{
    Point3 p;
    for (unsigned axis = 0; axis < 3; ++axis)
        p[axis] = (number >> axis & 1 ? 0.5 : -0.5) * box.size[axis];
    return transform(box.pose, p);
}

std::vector<Polygon> faces_of(const PlacedBox& box)
{
    std::vector<Polygon> faces;
    for (unsigned axis = 0; axis < 3; ++axis)
        for (unsigned side = 0; side < 2; ++side) {
            const unsigned u = 1u << (axis + 1) % 3, v = 1u << (axis + 2) % 3, at = side << axis;
            faces.push_back({corner(box, at), corner(box, at | u), corner(box, at | u | v), corner(box, at | v)});
        }
    return faces;
}

// what lies beyond z = near
Polygon cut(const Polygon& polygon, double near)
{
    Polygon kept;
    for (size_t i = 0; i < polygon.size(); ++i) {
        const Point3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        if (a[2] >= near)
            kept.push_back(a);
        if ((a[2] >= near) != (b[2] >= near))
            kept.push_back(between(a, b, (near - a[2]) / (b[2] - a[2])));
    }
    return kept;
}

// where a ray from the camera meets a box, in lengths of the ray
std::optional<std::array<double, 2>> meets(const PlacedBox& box, const Point3& ray)
{
    const Rigid to_box = inverse(box.pose);
    const Point3 from = translation_of(to_box), at = transform(to_box, ray);
    double enter = 0, leave = std::numeric_limits<double>::infinity();
    for (size_t axis = 0; axis < 3; ++axis) {
        const double half = box.size[axis] / 2, step = at[axis] - from[axis];
        const double low = (-half - from[axis]) / step, high = (half - from[axis]) / step;
        if (step == 0 && std::abs(from[axis]) > half)
            return std::nullopt;
        if (step != 0) {
            enter = std::max(enter, std::min(low, high));
            leave = std::min(leave, std::max(low, high));
        }
    }
    return enter <= leave ? std::optional(std::array{enter, leave}) : std::nullopt;
}

} // namespace

// takes what is seen, piece by piece
class BoxProjection::Outline {
  public:
    Outline(const BoxProjection& of) : of_(of) {}

    void add_edge(const Point3& a, const Point3& b)
    {
        const int steps = of_.intrinsics_.model == CameraModel::pinhole && !of_.moving_ ? 1 : kSteps;
        std::optional<Projection> last;
        for (int i = 0; i <= steps; ++i) {
            const double t = double(i) / steps;
            const auto now = of_.project(between(a, b, t));
            if (i > 0 && now.has_value() != last.has_value())
                add(end_of_seen(a, b, last ? t - 1.0 / steps : t, last ? t : t - 1.0 / steps));
            if (now && last && std::abs(now->x - last->x) > of_.intrinsics_.width / 2.0)
                crosses_seam_ = true;
            whole_ = whole_ && now;
            add(now);
            last = now;
        }
    }
    // where the box is behind the lens' limit, its picture ends there
    void add_limit(const PlacedBox& box)
    {
        const Intrinsics& k = of_.intrinsics_;
        const double limit = of_.lens_.limit() * kJustInside;
        for (int i = 0; i < kDirections; ++i) {
            const double turn = 2 * std::numbers::pi * i / kDirections;
            const double across = k.model == CameraModel::opencv ? limit : std::sin(limit);
            const double ahead = k.model == CameraModel::opencv ? 1 : std::cos(limit);
            const Point3 ray = {across * std::cos(turn), across * std::sin(turn), ahead};
            if (meets(box, ray))
                add(of_.project(ray));
        }
    }
    // the whole width of a panorama, from or to a pole or both
    void widen(bool up, bool down)
    {
        area_.left = 0;
        area_.right = of_.intrinsics_.width;
        area_.top = up ? 0 : area_.top;
        area_.bottom = down ? of_.intrinsics_.height : area_.bottom;
        empty_ = false;
    }
    bool crosses_seam() const { return crosses_seam_; }
    bool whole() const { return whole_; } // all edges are seen
    std::optional<PictureBox> area() const { return empty_ ? std::nullopt : std::optional(area_); }

  private:
    std::optional<Projection> end_of_seen(const Point3& a, const Point3& b, double seen, double unseen) const
    {
        for (int i = 0; i < kHalvings; ++i) {
            const double middle = (seen + unseen) / 2;
            (of_.project(between(a, b, middle)) ? seen : unseen) = middle;
        }
        return of_.project(between(a, b, seen));
    }
    void add(const std::optional<Projection>& p)
    {
        if (!p)
            return;
        area_ = empty_ ? PictureBox{p->x, p->y, p->x, p->y}
                       : PictureBox{std::min(area_.left, p->x), std::min(area_.top, p->y), std::max(area_.right, p->x),
                                    std::max(area_.bottom, p->y)};
        empty_ = false;
    }

    const BoxProjection& of_;
    PictureBox area_;
    bool empty_ = true, whole_ = true, crosses_seam_ = false;
};

// note: lenses map directions to pixels one to one, so the picture of a box ends where its edges are, or where it is
// cut
std::optional<PictureBox> BoxProjection::amodal(const PlacedBox& box) const
{
    const bool flat = intrinsics_.model == CameraModel::pinhole || intrinsics_.model == CameraModel::opencv;
    Outline outline(*this);
    for (const Polygon& face : faces_of(box)) {
        const Polygon kept = flat ? cut(face, near_) : face;
        for (size_t i = 0; i < kept.size(); ++i)
            outline.add_edge(kept[i], kept[(i + 1) % kept.size()]);
    }
    if (intrinsics_.model == CameraModel::equirectangular) {
        const bool up = meets(box, {0, -1, 0}).has_value(), down = meets(box, {0, 1, 0}).has_value();
        if (up || down || outline.crosses_seam())
            outline.widen(up, down);
        return outline.area();
    }
    const bool inside = meets(box, {0, 0, 1}) && meets(box, {0, 0, -1});
    if (intrinsics_.model != CameraModel::pinhole && (!outline.whole() || inside))
        outline.add_limit(box);
    return outline.area();
}

std::optional<std::array<double, 2>> BoxProjection::depths(const PlacedBox& box, uint32_t x, uint32_t y) const
{
    const auto ray = lens_.ray(x + 0.5, y + 0.5);
    const auto met = ray ? meets(box, *ray) : std::nullopt;
    if (!met)
        return std::nullopt;
    const double scale = lens_.depth(*ray);
    return std::array{(*met)[0] * scale, (*met)[1] * scale};
}

PictureBox BoxProjection::inside(const PictureBox& box) const
{
    const double w = intrinsics_.width, h = intrinsics_.height;
    return {std::clamp(box.left, 0.0, w), std::clamp(box.top, 0.0, h), std::clamp(box.right, 0.0, w),
            std::clamp(box.bottom, 0.0, h)};
}

double BoxProjection::outside(const PictureBox& box) const
{
    return box.area() > 0 ? 1 - inside(box).area() / box.area() : 0;
}

} // namespace semrover
