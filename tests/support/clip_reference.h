// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <vector>

// clipping as textbooks give it, in double: half-open, so that what lies in a voxel's upper border is not in it
namespace semrover {

using Point3d = std::array<double, 3>;

inline std::vector<Point3d> clipped_half(const std::vector<Point3d>& in, size_t axis, double bound, bool below)
{
    std::vector<Point3d> out;
    const auto inside = [&](const Point3d& p) { return below ? p[axis] < bound : p[axis] >= bound; };
    for (size_t i = 0; i < in.size(); ++i) {
        const Point3d &a = in[i], &b = in[(i + 1) % in.size()];
        if (inside(a))
            out.push_back(a);
        if (inside(a) != inside(b)) {
            const double t = (bound - a[axis]) / (b[axis] - a[axis]);
            Point3d p;
            for (size_t k = 0; k < 3; ++k)
                p[k] = a[k] + t * (b[k] - a[k]);
            p[axis] = bound;
            out.push_back(p);
        }
    }
    return out;
}

inline std::vector<Point3d> clipped(const std::array<Point3d, 3>& triangle, const std::array<int, 3>& cell, double size)
{
    std::vector<Point3d> p(triangle.begin(), triangle.end());
    for (size_t axis = 0; axis < 3; ++axis) {
        p = clipped_half(p, axis, cell[axis] * size, false);
        p = clipped_half(p, axis, (cell[axis] + 1) * size, true);
    }
    return p;
}

inline double triangle_area(const Point3d& a, const Point3d& b, const Point3d& c)
{
    Point3d u, v;
    for (size_t k = 0; k < 3; ++k) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
    }
    return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

inline double polygon_area(const std::vector<Point3d>& p)
{
    double sum = 0;
    for (size_t i = 1; i + 1 < p.size(); ++i)
        sum += triangle_area(p[0], p[i], p[i + 1]);
    return sum;
}

inline double segment_distance(const Point3d& p, const Point3d& a, const Point3d& b)
{
    double dot = 0, length2 = 0, d2 = 0;
    for (size_t k = 0; k < 3; ++k) {
        dot += (p[k] - a[k]) * (b[k] - a[k]);
        length2 += (b[k] - a[k]) * (b[k] - a[k]);
    }
    const double t = length2 > 0 ? std::min(1.0, std::max(0.0, dot / length2)) : 0;
    for (size_t k = 0; k < 3; ++k)
        d2 += std::pow(p[k] - a[k] - t * (b[k] - a[k]), 2);
    return std::sqrt(d2);
}

// where the foot on the plane has weights of one sign the height, else the nearest edge
inline double triangle_distance(const Point3d& p, const std::array<Point3d, 3>& t)
{
    Point3d u, v, w, n;
    for (size_t k = 0; k < 3; ++k) {
        u[k] = t[1][k] - t[0][k];
        v[k] = t[2][k] - t[0][k];
        w[k] = p[k] - t[0][k];
    }
    n = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    const auto dot = [](const Point3d& a, const Point3d& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
    const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), wu = dot(w, u), wv = dot(w, v);
    const double det = uu * vv - uv * uv;
    if (det > 0) {
        const double b = (vv * wu - uv * wv) / det, c = (uu * wv - uv * wu) / det;
        if (b >= 0 && c >= 0 && b + c <= 1)
            return std::abs(dot(w, n)) / std::sqrt(dot(n, n));
    }
    return std::min(
        {segment_distance(p, t[0], t[1]), segment_distance(p, t[1], t[2]), segment_distance(p, t[2], t[0])});
}

} // namespace semrover
