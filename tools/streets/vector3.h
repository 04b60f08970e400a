// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>

namespace semrover {

// metres, x forward, y left, z up
struct Vector3 {
    double x = 0, y = 0, z = 0;
};

inline Vector3 operator+(const Vector3& a, const Vector3& b)
{
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vector3 operator-(const Vector3& a, const Vector3& b)
{
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vector3 operator*(const Vector3& a, double s)
{
    return {a.x * s, a.y * s, a.z * s};
}
inline double dot(const Vector3& a, const Vector3& b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vector3 cross(const Vector3& a, const Vector3& b)
{
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(const Vector3& a)
{
    return std::sqrt(dot(a, a));
}
inline Vector3 normalized(const Vector3& a)
{
    const double l = length(a);
    return l > 0 ? a * (1 / l) : Vector3{0, 0, 1};
}
inline Vector3 mix(const Vector3& a, const Vector3& b, double t)
{
    return a + (b - a) * t;
}

// where a thing stands: its own x, y, z axes in the world
struct Frame {
    Vector3 origin, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};

    Vector3 at(double px, double py, double pz) const { return origin + x * px + y * py + z * pz; }
    Vector3 at(const Vector3& p) const { return at(p.x, p.y, p.z); }
    Frame moved(double px, double py, double pz) const { return {at(px, py, pz), x, y, z}; }
    // turned about z, counter-clockwise seen from above
    Frame turned(double radians) const
    {
        const double c = std::cos(radians), s = std::sin(radians);
        return {origin, x * c + y * s, y * c - x * s, z};
    }
};

// upright, x along the heading (radians from the world's x towards y)
inline Frame upright_frame(const Vector3& origin, double heading)
{
    return Frame{origin}.turned(heading);
}

} // namespace semrover
