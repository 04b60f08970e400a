// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/rigid.h"

#include <algorithm>
#include <cmath>

namespace semrover {

namespace {

constexpr double kRotationSlack = 1e-3; // files of four decimals are off by 1e-4

bool all_finite(std::span<const double> values)
{
    return std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
}

double dot(const Point3& a, const Point3& b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Point3 cross(const Point3& a, const Point3& b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Point3 unit_vector(const Point3& a)
{
    const double length = std::sqrt(dot(a, a));
    return {a[0] / length, a[1] / length, a[2] / length};
}

Point3 column(std::span<const double> rows, size_t i)
{
    return {rows[i], rows[4 + i], rows[8 + i]};
}

Rigid from_columns(const Point3& x, const Point3& y, const Point3& z, const Point3& t)
{
    return {x[0], y[0], z[0], t[0], x[1], y[1], z[1], t[1], x[2], y[2], z[2], t[2], 0, 0, 0, 1};
}

Rigid from_quaternion(const Quaternion& unit, const Point3& translation)
{
    const auto [x, y, z, w] = unit;
    return from_columns({1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
                        {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
                        {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}, translation);
}

bool same_rotation(const Rigid& a, const Rigid& b)
{
    return std::ranges::equal(std::span(a).first(3), std::span(b).first(3)) &&
           std::ranges::equal(std::span(a).subspan(4, 3), std::span(b).subspan(4, 3)) &&
           std::ranges::equal(std::span(a).subspan(8, 3), std::span(b).subspan(8, 3));
}

// beyond it nothing is drawn with any precision; earth-centred and map coordinates are within
constexpr double kMostMetres = 1e8;

Status check_place(const Point3& p, std::string_view where)
{
    for (const double x : p)
        if (!(std::abs(x) <= kMostMetres))
            return fail(ErrorCode::bad_input, "{}: a pose at {:g}, {:g}, {:g} m, at most {:g} are supported", where,
                        p[0], p[1], p[2], kMostMetres);
    return {};
}

} // namespace

Rigid compose(const Rigid& a, const Rigid& b)
{
    Rigid c{};
    for (size_t row = 0; row < 4; ++row)
        for (size_t col = 0; col < 4; ++col)
            for (size_t k = 0; k < 4; ++k)
                c[row * 4 + col] += a[row * 4 + k] * b[k * 4 + col];
    return c;
}

Rigid inverse(const Rigid& a)
{
    // [R t]^-1 = [R^T  -R^T t]
    const Point3 t = translation_of(a), x = column(a, 0), y = column(a, 1), z = column(a, 2);
    return {x[0], x[1], x[2], -dot(x, t), y[0], y[1], y[2], -dot(y, t), z[0], z[1], z[2], -dot(z, t), 0, 0, 0, 1};
}

Point3 transform(const Rigid& a, const Point3& p)
{
    Point3 q;
    for (size_t row = 0; row < 3; ++row)
        q[row] = a[row * 4] * p[0] + a[row * 4 + 1] * p[1] + a[row * 4 + 2] * p[2] + a[row * 4 + 3];
    return q;
}

Quaternion quaternion_of(const Rigid& a)
{
    // of 4w^2, 4x^2, 4y^2, 4z^2 the largest is at least 1, so its root divides without loss (Shepperd 1978)
    const double xx = a[0], yy = a[5], zz = a[10];
    const double squares[4] = {1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz};
    Quaternion q;
    switch (std::ranges::max_element(squares) - squares) {
    case 0:
        q = {squares[0], a[1] + a[4], a[2] + a[8], a[9] - a[6]};
        break;
    case 1:
        q = {a[1] + a[4], squares[1], a[6] + a[9], a[2] - a[8]};
        break;
    case 2:
        q = {a[2] + a[8], a[6] + a[9], squares[2], a[4] - a[1]};
        break;
    default:
        q = {a[9] - a[6], a[2] - a[8], a[4] - a[1], squares[3]};
        break;
    }
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& v : q)
        v = v / (q[3] < 0 ? -norm : norm);
    return q;
}

Rigid interpolate(const Rigid& a, const Rigid& b, double share)
{
    if (share == 0 || share == 1)
        return share == 0 ? a : b;
    Rigid c = a;
    // a turned by a share of the turn from a to b
    const Quaternion q = quaternion_of(compose(inverse(a), b));
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), half = share * std::atan2(sine, q[3]);
    if (sine > 0 && !same_rotation(a, b)) {
        const double part = std::sin(half) / sine;
        c = compose(a, from_quaternion({q[0] * part, q[1] * part, q[2] * part, std::cos(half)}, {}));
    }
    for (const size_t i : {3, 7, 11})
        c[i] = a[i] + share * (b[i] - a[i]);
    return c;
}

Result<Rigid> rigid_from_quaternion(const Point3& translation, const Quaternion& rotation, std::string_view where)
{
    if (!all_finite(translation) || !all_finite(rotation))
        return fail(ErrorCode::bad_input, "{}: a pose with a number that is not finite", where);
    SR_CHECK(check_place(translation, where));
    auto [x, y, z, w] = rotation;
    const double norm = std::sqrt(x * x + y * y + z * z + w * w);
    if (norm < 0.9 || norm > 1.1)
        return fail(ErrorCode::bad_input, "{}: expected a quaternion of norm 1, found {:.3g}; the order is x y z w",
                    where, norm);
    x /= norm;
    y /= norm;
    z /= norm;
    w /= norm;
    return from_quaternion({x, y, z, w}, translation);
}

Result<Rigid> rigid_from_matrix(std::span<const double> values, std::string_view where)
{
    if (values.size() != 12 && values.size() != 16)
        return fail(ErrorCode::bad_input, "{}: expected a 4x4 or 3x4 matrix, found {} numbers", where, values.size());
    if (!all_finite(values))
        return fail(ErrorCode::bad_input, "{}: a matrix with a number that is not finite", where);
    SR_CHECK(check_place(column(values, 3), where));
    const double last[4] = {0, 0, 0, 1};
    for (size_t i = 12; i < values.size(); ++i)
        if (std::abs(values[i] - last[i - 12]) > kRotationSlack)
            return fail(ErrorCode::bad_input, "{}: expected a matrix whose last row is 0 0 0 1", where);
    const Point3 x = column(values, 0), y = column(values, 1), z = column(values, 2);
    const double off = std::max({std::abs(dot(x, x) - 1), std::abs(dot(y, y) - 1), std::abs(dot(z, z) - 1),
                                 std::abs(dot(x, y)), std::abs(dot(x, z)), std::abs(dot(y, z))});
    if (!(off <= 2 * kRotationSlack) || dot(cross(x, y), z) < 0)
        return fail(ErrorCode::bad_input,
                    "{}: expected a rotation without scale or mirror, found one that is off by {:.3g}{}", where, off,
                    dot(cross(x, y), z) < 0 ? " and mirrored" : "");
    const Point3 x1 = unit_vector(x);
    const double along = dot(x1, y);
    const Point3 y1 = unit_vector({y[0] - along * x1[0], y[1] - along * x1[1], y[2] - along * x1[2]});
    return from_columns(x1, y1, cross(x1, y1), column(values, 3));
}

} // namespace semrover
