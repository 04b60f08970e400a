// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/base/result.h"

#include <array>
#include <span>
#include <string_view>

namespace semrover {

// a rotation and a translation in metres, as a row-major 4x4 matrix [R t; 0 1] that is applied to column vectors
using Rigid = std::array<double, 16>;
using Point3 = std::array<double, 3>;
using Quaternion = std::array<double, 4>; // x, y, z, w

constexpr Rigid kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
// OpenGL camera axes in OpenCV's: y and z turn over; its own inverse
constexpr Rigid kFlipYZ = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1};

Rigid compose(const Rigid& a, const Rigid& b); // a after b
Rigid inverse(const Rigid& a);
Point3 transform(const Rigid& a, const Point3& p);
inline Point3 translation_of(const Rigid& a)
{
    return {a[3], a[7], a[11]};
}
Quaternion quaternion_of(const Rigid& a); // unit, w >= 0

// Between two poses: the position linear, the rotation at even speed about one axis, the shorter way (slerp). `share` 0
// gives a, 1 gives b, to the bit; between equal poses all are equal. Beyond 0..1 the motion goes on. Of two rotations
// half a turn apart either way may be taken.
Rigid interpolate(const Rigid& a, const Rigid& b, double share);

// bad_input, with `where` in front, unless all numbers are finite and the quaternion's norm is in [0.9, 1.1] (it is
// then normalised)
Result<Rigid> rigid_from_quaternion(const Point3& translation, const Quaternion& rotation, std::string_view where);

// 12 (3x4) or 16 (4x4) numbers, row-major; bad_input unless they are finite and a rotation to 1e-3 (then made one to
// the last bit), without mirror or scale, and a last row of 0 0 0 1
Result<Rigid> rigid_from_matrix(std::span<const double> values, std::string_view where);

} // namespace semrover
