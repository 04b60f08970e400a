// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/lens.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace semrover {

namespace {

using std::numbers::pi;

constexpr double kFarthest = 1e4; // of an opencv lens: 89.994 degrees

constexpr double kFarthestPixel = 65536; // of an f-theta lens, from its centre

struct Slope {
    double value, derivative;
};

// R and its derivative by s = r^2
Slope opencv_factor(const Distortion& k, double s)
{
    const double top = 1 + s * (k[0] + s * (k[1] + s * k[4])), bottom = 1 + s * (k[5] + s * (k[6] + s * k[7]));
    const double top_slope = k[0] + s * (2 * k[1] + s * 3 * k[4]), bottom_slope = k[5] + s * (2 * k[6] + s * 3 * k[7]);
    return {top / bottom, (top_slope * bottom - top * bottom_slope) / (bottom * bottom)};
}

// distance from the axis on the image, without what is not radial, of distance r at z = 1
Slope opencv_distance(const Distortion& k, double r)
{
    const Slope factor = opencv_factor(k, r * r);
    return {r * factor.value, factor.value + 2 * r * r * factor.derivative};
}

// of an angle from the axis
Slope fisheye_distance(const Distortion& k, double angle)
{
    const double s = angle * angle;
    return {angle * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))),
            1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))};
}

struct Bent {
    double a, b;
    double aa, ab, ba, bb; // derivatives: ab of a by b

    double det() const { return aa * bb - ab * ba; }
};

Bent bend(const Distortion& k, double a, double b)
{
    const double p1 = k[2], p2 = k[3], s = a * a + b * b;
    const Slope factor = opencv_factor(k, s);
    const double prism_a = 2 * (k[8] + 2 * k[9] * s), prism_b = 2 * (k[10] + 2 * k[11] * s); // by s, times 2
    const double across = 2 * a * b * factor.derivative + 2 * p1 * a + 2 * p2 * b;
    return {a * factor.value + 2 * p1 * a * b + p2 * (s + 2 * a * a) + s * (k[8] + s * k[9]),
            b * factor.value + p1 * (s + 2 * b * b) + 2 * p2 * a * b + s * (k[10] + s * k[11]),
            factor.value + 2 * a * a * factor.derivative + 2 * p1 * b + 6 * p2 * a + prism_a * a,
            across + prism_a * b,
            across + prism_b * a,
            factor.value + 2 * b * b * factor.derivative + 6 * p1 * b + 2 * p2 * a + prism_b * b};
}

// nothing but what depends on the distance from the axis
bool is_radial(const Distortion& k)
{
    return k[2] == 0 && k[3] == 0 && k[8] == 0 && k[9] == 0 && k[10] == 0 && k[11] == 0;
}

// does the mapping keep its orientation all around the circle of radius r, with nothing infinite on the way?
bool opencv_holds(const Distortion& k, double r)
{
    const double s = r * r;
    if (!(1 + s * (k[5] + s * (k[6] + s * k[7])) > 0) || !(opencv_distance(k, r).derivative > 0) ||
        !(opencv_factor(k, s).value > 0))
        return false;
    if (is_radial(k))
        return true;
    constexpr int kDirections = 48;
    for (int i = 0; i < kDirections; ++i) {
        const double angle = 2 * pi * i / kDirections;
        const Bent d = bend(k, r * std::cos(angle), r * std::sin(angle));
        if (!(d.det() > 0 && d.aa + d.bb > 0))
            return false;
    }
    return true;
}

// the last value before `holds` fails: steps from low by a factor and a summand, then halves
double last_that_holds(double first, double factor, double summand, double end,
                       const std::function<bool(double)>& holds)
{
    double good = 0;
    for (double x = first; x < end; x = x * factor + summand) {
        if (holds(x)) {
            good = x;
            continue;
        }
        double bad = x;
        for (int i = 0; i < 60; ++i) {
            const double middle = (good + bad) / 2;
            (holds(middle) ? good : bad) = middle;
        }
        return good;
    }
    return end;
}

// x in [0, end] with f(x) = y, f rising: Newton's method, halving where it would leave the bracket; end if y is beyond
template <typename F>
double solve_rising(const F& f, double y, double end)
{
    double low = 0, high = end, x = std::min(y, end);
    if (f(end).value <= y)
        return end;
    for (int i = 0; i < 100; ++i) {
        const Slope at = f(x);
        (at.value < y ? low : high) = x;
        double next = x - (at.value - y) / at.derivative;
        if (!(next >= low && next <= high))
            next = (low + high) / 2;
        if (std::abs(next - x) <= 1e-16 * (1 + x))
            return next;
        x = next;
    }
    return x;
}

// the reference polynomial of an f-theta lens, without a constant
Slope ftheta_polynomial(const Distortion& k, double x)
{
    return {x * (k[0] + x * (k[1] + x * (k[2] + x * (k[3] + x * k[4])))),
            k[0] + x * (2 * k[1] + x * (3 * k[2] + x * (4 * k[3] + x * 5 * k[4])))};
}

Point3 unit(double x, double y, double z)
{
    const double length = std::sqrt(x * x + y * y + z * z);
    return {x / length, y / length, z / length};
}

} // namespace

Lens::Lens(const Intrinsics& intrinsics) : intrinsics_(intrinsics)
{
    const Distortion& k = intrinsics_.distortion;
    if (intrinsics_.model == CameraModel::opencv)
        limit_ = last_that_holds(1e-3, 1.01, 0, kFarthest, [&](double r) { return opencv_holds(k, r); });
    if (intrinsics_.model == CameraModel::fisheye)
        limit_ = last_that_holds(1e-3, 1, 1e-3, pi, [&](double t) { return fisheye_distance(k, t).derivative > 0; });
    if (intrinsics_.model == CameraModel::ftheta)
        find_ftheta_ends();
    radial_depth_ =
        intrinsics_.model == CameraModel::equirectangular ||
        ((intrinsics_.model == CameraModel::fisheye || intrinsics_.model == CameraModel::ftheta) && sees_sideways());
}

// where the polynomial stops to rise, or reaches max_angle
void Lens::find_ftheta_ends()
{
    const Distortion& k = intrinsics_.distortion;
    const auto rises = [&](double x) { return ftheta_polynomial(k, x).derivative > 0; };
    const double most = std::min(k[8], pi);
    if (k[9] == 0) {
        limit_ = last_that_holds(1e-3, 1, 1e-3, most, rises);
        reach_ = ftheta_polynomial(k, limit_).value;
        return;
    }
    reach_ = last_that_holds(1, 1, 1, kFarthestPixel,
                             [&](double x) { return rises(x) && ftheta_polynomial(k, x).value <= most; });
    limit_ = ftheta_polynomial(k, reach_).value;
}

double Lens::ftheta_distance(double angle) const
{
    const auto f = [this](double x) { return ftheta_polynomial(intrinsics_.distortion, x); };
    return intrinsics_.distortion[9] == 0 ? f(angle).value : solve_rising(f, angle, reach_);
}

double Lens::ftheta_angle(double distance) const
{
    const auto f = [this](double x) { return ftheta_polynomial(intrinsics_.distortion, x); };
    return intrinsics_.distortion[9] == 0 ? solve_rising(f, distance, limit_) : f(distance).value;
}

bool Lens::sees_sideways() const
{
    if (limit_ <= pi / 2)
        return false;
    const bool ftheta = intrinsics_.model == CameraModel::ftheta;
    const double edge = ftheta ? ftheta_distance(pi / 2) : fisheye_distance(intrinsics_.distortion, pi / 2).value;
    double farthest = 0;
    for (const double x : {0.0, double(intrinsics_.width)})
        for (const double y : {0.0, double(intrinsics_.height)}) {
            const auto [a, b] = from_image(x, y);
            farthest = std::max(farthest, std::hypot(a, b));
        }
    return farthest > edge;
}

// a position of the picture, in focal lengths from the centre; of an f-theta lens its linear part undone
std::array<double, 2> Lens::from_image(double x, double y) const
{
    const double a = (x - intrinsics_.cx) / intrinsics_.fx, b = (y - intrinsics_.cy) / intrinsics_.fy;
    if (intrinsics_.model != CameraModel::ftheta)
        return {a, b};
    const Distortion& k = intrinsics_.distortion;
    const double det = k[5] - k[6] * k[7];
    return {(a - k[6] * b) / det, (k[5] * b - k[7] * a) / det};
}

double Lens::depth(const Point3& point) const
{
    const auto [x, y, z] = point;
    return radial_depth_ ? std::sqrt(x * x + y * y + z * z) : z;
}

std::optional<Projection> Lens::project(const Point3& point) const
{
    const Intrinsics& k = intrinsics_;
    const auto [x, y, z] = point;
    const double across = std::hypot(x, y), away = std::sqrt(x * x + y * y + z * z);
    double a = 0, b = 0;
    switch (k.model) {
    case CameraModel::pinhole:
    case CameraModel::opencv: {
        if (!(z > 0))
            return std::nullopt;
        a = x / z;
        b = y / z;
        if (k.model == CameraModel::opencv) {
            if (std::hypot(a, b) > limit_)
                return std::nullopt;
            const Bent bent = bend(k.distortion, a, b);
            a = bent.a;
            b = bent.b;
        }
        break;
    }
    case CameraModel::fisheye: {
        const double angle = std::atan2(across, z);
        if (!(away > 0) || angle > limit_ || (across == 0 && z < 0))
            return std::nullopt;
        const double scale = across > 0 ? fisheye_distance(k.distortion, angle).value / across : 0;
        a = x * scale;
        b = y * scale;
        break;
    }
    case CameraModel::ftheta: {
        const double angle = std::atan2(across, z);
        if (!(away > 0) || angle > limit_ || (across == 0 && z < 0))
            return std::nullopt;
        const double scale = across > 0 ? ftheta_distance(angle) / across : 0;
        a = scale * (k.distortion[5] * x + k.distortion[6] * y);
        b = scale * (k.distortion[7] * x + y);
        break;
    }
    case CameraModel::equirectangular:
        if (!(away > 0))
            return std::nullopt;
        a = std::atan2(x, z);
        b = std::atan2(y, std::hypot(x, z));
        break;
    }
    return Projection{k.fx * a + k.cx, k.fy * b + k.cy, depth(point)};
}

std::optional<Point3> Lens::ray(double x, double y) const
{
    const auto [a, b] = from_image(x, y);
    switch (intrinsics_.model) {
    case CameraModel::opencv:
        return opencv_ray(a, b);
    case CameraModel::fisheye:
        return fisheye_ray(a, b);
    case CameraModel::ftheta:
        return ftheta_ray(a, b);
    case CameraModel::equirectangular:
        if (std::abs(b) > pi / 2)
            return std::nullopt;
        return Point3{std::sin(a) * std::cos(b), std::sin(b), std::cos(a) * std::cos(b)};
    case CameraModel::pinhole:
        break;
    }
    return unit(a, b, 1);
}

// first without what is not radial, which only matters little, then Newton's method in two dimensions
std::optional<Point3> Lens::opencv_ray(double a, double b) const
{
    const Distortion& k = intrinsics_.distortion;
    const double bent = std::hypot(a, b);
    const double r = solve_rising([&](double v) { return opencv_distance(k, v); }, bent, limit_);
    double u = bent > 0 ? a * r / bent : 0, v = bent > 0 ? b * r / bent : 0;
    for (int i = 0; i < 50; ++i) {
        const Bent at = bend(k, u, v);
        const double det = at.det(), da = a - at.a, db = b - at.b;
        const double du = (at.bb * da - at.ab * db) / det, dv = (at.aa * db - at.ba * da) / det;
        if (!std::isfinite(du) || !std::isfinite(dv))
            break;
        u += du;
        v += dv;
        const double distance = std::hypot(u, v);
        if (distance > limit_) { // back to where the formula holds
            u *= limit_ / distance;
            v *= limit_ / distance;
        }
        if (std::hypot(du, dv) <= 1e-15 * (1 + distance))
            break;
    }
    const Bent at = bend(k, u, v);
    if (!(std::hypot(at.a - a, at.b - b) <= 1e-10 * (1 + bent)))
        return std::nullopt;
    return unit(u, v, 1);
}

std::optional<Point3> Lens::fisheye_ray(double a, double b) const
{
    const Distortion& k = intrinsics_.distortion;
    const double bent = std::hypot(a, b);
    if (bent > fisheye_distance(k, limit_).value)
        return std::nullopt;
    if (bent == 0)
        return Point3{0, 0, 1};
    const double angle = solve_rising([&](double t) { return fisheye_distance(k, t); }, bent, limit_);
    return Point3{std::sin(angle) * a / bent, std::sin(angle) * b / bent, std::cos(angle)};
}

std::optional<Point3> Lens::ftheta_ray(double a, double b) const
{
    const double distance = std::hypot(a, b);
    if (distance > reach_)
        return std::nullopt;
    if (distance == 0)
        return Point3{0, 0, 1};
    const double angle = ftheta_angle(distance);
    return Point3{std::sin(angle) * a / distance, std::sin(angle) * b / distance, std::cos(angle)};
}

} // namespace semrover
