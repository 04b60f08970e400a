// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/trajectory/colmap_models.h"

#include "runtime/base/json_numbers.h"
#include "runtime/base/quote.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Cholesky>
#include <numbers>

namespace semrover {

namespace {

constexpr uint8_t kMustBeZero = 255; // of a coefficient's place: there is none for it here
constexpr uint8_t kOmega = 254;

const ColmapModel kModels[] = {
    {0, "SIMPLE_PINHOLE", CameraModel::pinhole, 1, {}},
    {1, "PINHOLE", CameraModel::pinhole, 2, {}},
    {2, "SIMPLE_RADIAL", CameraModel::opencv, 1, {0}},
    {3, "RADIAL", CameraModel::opencv, 1, {0, 1}},
    {4, "OPENCV", CameraModel::opencv, 2, {0, 1, 2, 3}},
    {6, "FULL_OPENCV", CameraModel::opencv, 2, {0, 1, 2, 3, 4, 5, 6, 7}},
    {14, "SIMPLE_FISHEYE", CameraModel::fisheye, 1, {}},
    {15, "FISHEYE", CameraModel::fisheye, 2, {}},
    {8, "SIMPLE_RADIAL_FISHEYE", CameraModel::fisheye, 1, {0}},
    {9, "RADIAL_FISHEYE", CameraModel::fisheye, 1, {0, 1}},
    {5, "OPENCV_FISHEYE", CameraModel::fisheye, 2, {0, 1, 2, 3}},
    // k1 k2 p1 p2 k3 k4 sx1 sy1
    {10,
     "THIN_PRISM_FISHEYE",
     CameraModel::fisheye,
     2,
     {0, 1, kMustBeZero, kMustBeZero, 2, 3, kMustBeZero, kMustBeZero}},
    {7, "FOV", CameraModel::fisheye, 2, {kOmega}},
    {17, "EQUIRECTANGULAR", CameraModel::equirectangular, 0, {}},
};

// Devernay and Faugeras 2001: the image's radius at an angle from the axis, in focal lengths
double fov_radius(double angle, double omega)
{
    return std::atan(2 * std::tan(angle) * std::tan(omega / 2)) / omega;
}

// the angle that a radius comes from
double fov_angle(double radius, double omega)
{
    return std::atan(std::tan(radius * omega) / (2 * std::tan(omega / 2)));
}

// farthest corner of the image from the centre, in focal lengths
double farthest_corner(const Intrinsics& k)
{
    double farthest = 0;
    for (const double x : {0.0, double(k.width)})
        for (const double y : {0.0, double(k.height)})
            farthest = std::max(farthest, std::hypot((x - k.cx) / k.fx, (y - k.cy) / k.fy));
    return farthest;
}

// least squares over the image of focal, k1 .. k4, in powers of the angle's share of the largest
Status fit_fov(Intrinsics& k, double omega, std::string_view where)
{
    constexpr int kSteps = 400;
    constexpr int kTerms = 5;
    const double corner = farthest_corner(k);
    if (!(omega > 1e-6 && omega < std::numbers::pi) || corner * omega >= std::numbers::pi / 2)
        return fail(ErrorCode::bad_input, "{}: a FOV lens of omega {:.4g} that does not see the image's corners", where,
                    omega);
    const double largest = fov_angle(corner, omega);
    using Terms = Eigen::Matrix<double, kTerms, 1>;
    Eigen::Matrix<double, kTerms, kTerms> a = decltype(a)::Zero();
    Terms b = Terms::Zero();
    for (int i = 0; i < kSteps; ++i) { // Chebyshev's points: the error is the same all over
        const double t = std::sin(std::numbers::pi / 2 * (i + 0.5) / kSteps);
        Terms powers;
        powers[0] = t;
        for (int n = 1; n < kTerms; ++n)
            powers[n] = powers[n - 1] * t * t;
        b += powers * fov_radius(t * largest, omega);
        a += powers * powers.transpose();
    }
    const Terms c = a.ldlt().solve(b);
    double worst = 0;
    for (int i = 1; i <= kSteps; ++i) {
        const double t = double(i) / kSteps;
        double radius = 0;
        for (int n = kTerms; n-- > 0;)
            radius = radius * t * t + c[n];
        worst = std::max(worst, std::abs(radius * t - fov_radius(t * largest, omega)));
    }
    worst *= std::max(k.fx, k.fy);
    if (!(worst <= kMaxFovError))
        return fail(
            ErrorCode::bad_input,
            "{}: a FOV lens of omega {:.4g}: the nearest fisheye lens is {:.2g} pixels away from it, at most {} "
            "are accepted",
            where, omega, worst, kMaxFovError);
    const double focal = c[0] / largest;
    k.fx *= focal;
    k.fy *= focal;
    for (int n = 1; n < kTerms; ++n)
        k.distortion[size_t(n) - 1] = c[n] / c[0] / std::pow(largest, 2.0 * n);
    return {};
}

// "front/color/000001.png" and "front/000001.jpg" are pictures of the camera front, "color/000001.png" of none
std::string camera_of_picture(std::string_view picture)
{
    std::vector<std::string_view> folders;
    for (size_t slash; (slash = picture.find('/')) != std::string_view::npos; picture.remove_prefix(slash + 1))
        folders.push_back(picture.substr(0, slash));
    if (!folders.empty() && folders.back() == "color")
        folders.pop_back();
    return folders.size() == 1 && is_camera_name(folders[0]) ? std::string(folders[0]) : std::string();
}

} // namespace

const ColmapModel* colmap_model_of_name(std::string_view name)
{
    const auto found = std::ranges::find(kModels, name, &ColmapModel::name);
    return found == std::end(kModels) ? nullptr : &*found;
}

const ColmapModel* colmap_model_of_id(uint32_t id)
{
    const auto found = std::ranges::find(kModels, id, &ColmapModel::id);
    return found == std::end(kModels) ? nullptr : &*found;
}

std::string colmap_model_names()
{
    std::string text;
    for (const ColmapModel& m : kModels)
        text += fmt::format("{}{}", text.empty() ? "" : ", ", m.name);
    return text;
}

const ColmapModel& colmap_model_for(const Intrinsics& k)
{
    switch (k.model) {
    case CameraModel::opencv:
        return std::ranges::any_of(k.distortion.begin() + 4, k.distortion.end(), [](double v) { return v != 0; })
                   ? *colmap_model_of_name("FULL_OPENCV")
                   : *colmap_model_of_name("OPENCV");
    case CameraModel::fisheye:
        return *colmap_model_of_name("OPENCV_FISHEYE");
    case CameraModel::equirectangular:
        return *colmap_model_of_name("EQUIRECTANGULAR");
    case CameraModel::pinhole:
    case CameraModel::ftheta: // which writers refuse
        break;
    }
    return *colmap_model_of_name("PINHOLE");
}

Result<Intrinsics> colmap_intrinsics(const ColmapModel& model, const std::vector<double>& v, std::string_view where)
{
    Intrinsics k;
    SR_TRY(k.width, image_side(v[0], fmt::format("{}: width", where)));
    SR_TRY(k.height, image_side(v[1], fmt::format("{}: height", where)));
    if (v.size() - 2 != model.parameters())
        return fail(ErrorCode::bad_input, "{}: expected {} parameters of {}, found {}", where, model.parameters(),
                    model.name, v.size() - 2);
    if (!model.focals) {
        if (v[2] != v[0] || v[3] != v[1])
            return fail(ErrorCode::bad_input, "{}: a panorama of {} x {} in a picture of {} x {}", where, v[2], v[3],
                        v[0], v[1]);
        return whole_sphere(k.width, k.height);
    }
    k.model = model.model;
    k.fx = v[2];
    k.fy = v[1 + model.focals];
    k.cx = v[2 + model.focals];
    k.cy = v[3 + model.focals];
    SR_CHECK(check_intrinsics(k, where));
    for (size_t i = 0; i < model.coefficients.size(); ++i) {
        const double value = v[4 + model.focals + i];
        const uint8_t place = model.coefficients[i];
        if (place == kOmega)
            SR_CHECK(fit_fov(k, value, where));
        else if (place != kMustBeZero)
            k.distortion[place] = value;
        else if (value != 0)
            return fail(ErrorCode::bad_input,
                        "{}: a {} lens with p1, p2, sx1 or sy1 other than 0, which is not supported", where,
                        model.name);
    }
    SR_CHECK(check_intrinsics(k, where));
    return simplified(k);
}

Result<ColmapPicture> colmap_picture(const std::array<double, 4>& q, const std::array<double, 3>& t,
                                     const Intrinsics& intrinsics, std::string name, std::string_view where)
{
    ColmapPicture picture{std::move(name), {}};
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (norm < 0.9 || norm > 1.1)
        return fail(ErrorCode::bad_input, "{}: expected a quaternion of norm 1, found {:.3g}; the order is w x y z",
                    where, norm);
    SR_TRY(picture.frame.pose.world_to_camera, rigid_from_quaternion(t, {q[1], q[2], q[3], q[0]}, where));
    picture.frame.intrinsics = intrinsics;
    picture.frame.camera = camera_of_picture(picture.name);
    return picture;
}

} // namespace semrover
