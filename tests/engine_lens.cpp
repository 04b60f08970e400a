// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/camera/lens.h"
#include "tests/support/says.h"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>
#include <random>
#include <span>

namespace semrover {
namespace engine_lens_test {

// order k1 k2 p1 p2 k3 k4 k5 k6
const Intrinsics kOpencv{812.5,
                         809.25,
                         640.75,
                         361.5,
                         1280,
                         720,
                         CameraModel::opencv,
                         {-0.28, 0.09, 0.0012, -0.0007, -0.011, 0.05, -0.02, 0.004}};
const Intrinsics kFisheye{
    301.5, 299.75, 512.25, 480.5, 1024, 960, CameraModel::fisheye, {0.021, -0.013, 0.0041, -0.0006}};

const Intrinsics kPrism{kOpencv.fx,
                        kOpencv.fy,
                        kOpencv.cx,
                        kOpencv.cy,
                        1280,
                        720,
                        CameraModel::opencv,
                        {-0.28, 0.09, 0.0012, -0.0007, -0.011, 0.05, -0.02, 0.004, 0.0031, -0.0012, -0.0024, 0.0008}};
// polynomial, c d e, max_angle, from pixels to angles?
const Intrinsics kForward{1,
                          1,
                          639.75,
                          362.25,
                          1280,
                          720,
                          CameraModel::ftheta,
                          {520.5, -6.25, 3.5, -14.0, 2.0, 1.002, 0.0015, -0.0007, 1.75, 0}};
const Intrinsics kBackward{1,
                           1,
                           640.5,
                           360,
                           1280,
                           720,
                           CameraModel::ftheta,
                           {1.92e-3, 2.1e-8, -3.0e-11, 4.0e-14, -1.0e-17, 0.9985, -0.0011, 0.0006, 1.8, 1}};

struct Golden {
    Point3 point;
    double x, y;
};

// docs.opencv.org, calib3d: x'' = x' (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x' y' +
// p2 (r^2 + 2 x'^2), y'' = .. + p1 (r^2 + 2 y'^2) + 2 p2 x' y', evaluated in Python
TEST(Lens, opencv_is_what_its_formula_gives)
{
    const Golden golden[] = {{{0.4, -0.2, 1.5}, 851.0727130003303, 256.82043225916885},
                             {{1.2, 0.9, 2.0}, 1054.8678829536184, 671.631283956978},
                             {{-0.7, 0.35, 1.0}, 161.87088737194205, 600.4031138700228}};
    for (const Golden& g : golden) {
        const auto pixel = Lens(kOpencv).project(g.point);
        ASSERT_TRUE(pixel);
        EXPECT_NEAR(pixel->x, g.x, 1e-9);
        EXPECT_NEAR(pixel->y, g.y, 1e-9);
        EXPECT_EQ(pixel->depth, g.point[2]);
    }
    EXPECT_FALSE(Lens(kOpencv).project({0.1, 0, -1}));
    EXPECT_FALSE(Lens(kOpencv).project({0.1, 0, 0}));
}

// the same, and s1 r^2 + s2 r^4 beside x'', s3 r^2 + s4 r^4 beside y''
TEST(Lens, thin_prisms_are_what_their_formula_gives)
{
    const Golden golden[] = {{{0.4, -0.2, 1.5}, 851.288898185515, 256.652907518428},
                             {{1.2, 0.9, 2.0}, 1055.976183734868, 670.743637863228},
                             {{-0.7, 0.35, 1.0}, 163.047844403192, 599.456392526273}};
    for (const Golden& g : golden) {
        const auto pixel = Lens(kPrism).project(g.point);
        ASSERT_TRUE(pixel);
        EXPECT_NEAR(pixel->x, g.x, 1e-9);
        EXPECT_NEAR(pixel->y, g.y, 1e-9);
    }
}

// FThetaCameraModelParameters of NVIDIA's NCore: delta = polynomial of theta, or theta of delta; [c d; e 1] times
// delta (x, y) / hypot(x, y), from the principal point; evaluated in Python, the second with numpy.roots
TEST(Lens, ftheta_is_what_its_polynomial_gives)
{
    const Golden forward[] = {{{0.4, -0.2, 1.5}, 774.333952955307, 294.947942327368},
                              {{2.0, 1.0, 0.3}, 1265.927348582390, 674.042919618237},
                              {{-1.0, 0.5, -0.2}, -86.807904283552, 725.583375954831}};
    const Golden backward[] = {{{0.4, -0.2, 1.5}, 775.168441585033, 292.682628769766},
                               {{2.0, 1.0, 0.3}, 1304.453777702870, 693.058030079720},
                               {{-1.0, 0.5, -0.2}, -165.685088538236, 762.991675307537}};
    for (const auto& [k, golden] : {std::pair{kForward, std::span(forward)}, {kBackward, std::span(backward)}})
        for (const Golden& g : golden) {
            const auto pixel = Lens(k).project(g.point);
            ASSERT_TRUE(pixel);
            EXPECT_NEAR(pixel->x, g.x, 1e-8);
            EXPECT_NEAR(pixel->y, g.y, 1e-8);
            EXPECT_EQ(Lens(k).project({0, 0, 2})->x, k.cx);
        }
    for (const Intrinsics& k : {kForward, kBackward}) { // ends at max_angle
        const double limit = k.distortion[8];
        EXPECT_NEAR(Lens(k).limit(), limit, 1e-9);
        EXPECT_TRUE(Lens(k).project({std::sin(limit - 1e-6), 0, std::cos(limit - 1e-6)}));
        EXPECT_FALSE(Lens(k).project({std::sin(limit + 1e-6), 0, std::cos(limit + 1e-6)}));
        EXPECT_FALSE(Lens(k).radial_depth()); // whose corners are less than 90 degrees away
        Intrinsics wide = k;
        wide.width = 1800;
        EXPECT_TRUE(Lens(wide).radial_depth());
    }
    Intrinsics turns = kForward; // 520.5 t - 200 t^3 rises up to t = 0.931
    turns.distortion = {520.5, 0, -200, 0, 0, 1, 0, 0, 3, 0};
    EXPECT_NEAR(Lens(turns).limit(), std::sqrt(520.5 / 600), 1e-9);
    EXPECT_FALSE(Lens(turns).radial_depth());
}

// docs.opencv.org, calib3d/fisheye: theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), with
// theta = atan2(r, z) so that it goes on behind 90 degrees; evaluated in Python
TEST(Lens, fisheye_is_what_its_formula_gives)
{
    const Golden golden[] = {{{0.4, -0.2, 1.5}, 590.518072244035, 441.5931100246277},
                             {{2.0, 1.0, 0.1}, 928.9534709954747, 687.6423970661585},
                             {{-1.0, 0.5, -0.4}, -1.901120996683403, 736.083413795615}};
    for (const Golden& g : golden) {
        const auto pixel = Lens(kFisheye).project(g.point);
        ASSERT_TRUE(pixel);
        EXPECT_NEAR(pixel->x, g.x, 1e-9);
        EXPECT_NEAR(pixel->y, g.y, 1e-9);
    }
    const auto middle = Lens(kFisheye).project({0, 0, 2});
    EXPECT_EQ(middle->x, 512.25);
    EXPECT_EQ(middle->y, 480.5);
}

// longitude from z towards x, latitude up: x = (lon / 2 pi + 1/2) w, y = (1/2 - lat / pi) h (COLMAP's EQUIRECTANGULAR)
TEST(Lens, a_panorama_is_what_its_formula_gives)
{
    const Golden golden[] = {{{0.4, -0.2, 1.5}, 554.4715866400358, 235.1187768640955},
                             {{2.0, 1.0, 0.1}, 759.8580473568377, 331.4814570833125},
                             {{-1.0, 0.5, -0.4}, 193.9871019054882, 326.83388025043456}};
    const double depths[] = {1.5652475842498528, 2.238302928559939, 1.1874342087037917};
    for (size_t i = 0; i < 3; ++i) {
        const auto pixel = Lens(whole_sphere(1024, 512)).project(golden[i].point);
        ASSERT_TRUE(pixel);
        EXPECT_NEAR(pixel->x, golden[i].x, 1e-9);
        EXPECT_NEAR(pixel->y, golden[i].y, 1e-9);
        EXPECT_NEAR(pixel->depth, depths[i], 1e-12);
    }
    const Lens sphere(whole_sphere(8, 4));
    EXPECT_NEAR(sphere.project({0, -1, 0})->y, 0, 1e-12); // straight up
    EXPECT_NEAR(sphere.project({0, 1, 0})->y, 4, 1e-12);
    EXPECT_NEAR(sphere.project({1, 0, 0})->x, 6, 1e-12); // to the right
    EXPECT_NEAR(sphere.project({0, 0, -1})->x, 8, 1e-12);
    EXPECT_FALSE(sphere.project({0, 0, 0}));
}

std::vector<Intrinsics> lenses()
{
    Intrinsics tangential = kOpencv;
    tangential.distortion = {-0.1, 0, 0.03, -0.02};
    Intrinsics strong = kOpencv;
    strong.distortion = {-0.35, 0.12, 0, 0, -0.02};
    Intrinsics pincushion = kOpencv;
    pincushion.distortion = {0.4, 0.2, 0, 0, 0.1};
    Intrinsics barrel = kFisheye;
    barrel.distortion = {-0.05, 0.01, -0.004, 0.0003};
    return {pinhole_from_fov(90, 616, 424),
            kOpencv,
            tangential,
            strong,
            pincushion,
            kPrism,
            kForward,
            kBackward,
            kFisheye,
            barrel,
            fisheye_from_fov(220, 500, 400),
            whole_sphere(1024, 512)};
}

TEST(Lens, a_pixel_becomes_a_ray_becomes_the_pixel)
{
    std::mt19937 random(5);
    for (const Intrinsics& k : lenses()) {
        const Lens lens(k);
        size_t seen = 0;
        for (int i = 0; i < 2000; ++i) {
            const double x = k.width * double(random()) / 4294967296.0, y = k.height * double(random()) / 4294967296.0;
            const auto ray = lens.ray(x, y);
            if (!ray)
                continue;
            ++seen;
            const auto [a, b, c] = *ray;
            ASSERT_NEAR(a * a + b * b + c * c, 1, 1e-12);
            const auto pixel = lens.project({5 * a, 5 * b, 5 * c});
            ASSERT_TRUE(pixel) << name_of(k.model) << " " << x << ", " << y;
            ASSERT_NEAR(pixel->x, x, 1e-6) << name_of(k.model);
            ASSERT_NEAR(pixel->y, y, 1e-6) << name_of(k.model);
            ASSERT_NEAR(pixel->depth, lens.radial_depth() ? 5 : 5 * c, 1e-9);
        }
        EXPECT_GT(seen, 1000u) << name_of(k.model);
    }
}

TEST(Lens, a_point_becomes_a_pixel_becomes_its_ray_up_to_the_limit)
{
    std::mt19937 random(6);
    for (const Intrinsics& k : lenses()) {
        const Lens lens(k);
        const bool plane = k.model == CameraModel::opencv || k.model == CameraModel::pinhole;
        const double limit = k.model == CameraModel::pinhole           ? 5
                             : k.model == CameraModel::equirectangular ? std::numbers::pi
                                                                       : std::min(lens.limit(), 50.0);
        for (int i = 0; i < 2000; ++i) {
            const double away = 0.99 * limit * double(random()) / 4294967296.0;
            const double around = 2 * std::numbers::pi * double(random()) / 4294967296.0,
                         angle = plane ? std::atan(away) : away;
            const Point3 p = {std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around), std::cos(angle)};
            const auto pixel = lens.project(p);
            ASSERT_TRUE(pixel) << name_of(k.model) << " " << angle;
            const auto ray = lens.ray(pixel->x, pixel->y);
            ASSERT_TRUE(ray) << name_of(k.model) << " " << angle << " " << k.distortion[0];
            for (size_t a = 0; a < 3; ++a)
                ASSERT_NEAR((*ray)[a], p[a], 1e-6) << name_of(k.model) << " " << angle;
        }
    }
}

// r (1 + k1 r^2) rises up to r = 1 / sqrt(-3 k1); t (1 + k1 t^2) likewise
TEST(Lens, a_lens_ends_where_its_mapping_turns_back)
{
    const Intrinsics opencv{100, 100, 50, 50, 100, 100, CameraModel::opencv, {-0.4}};
    const Lens folding(opencv);
    const double edge = 1 / std::sqrt(1.2);
    EXPECT_NEAR(folding.limit(), edge, 1e-9);
    EXPECT_TRUE(folding.project({0.999 * edge, 0, 1}));
    EXPECT_FALSE(folding.project({1.001 * edge, 0, 1})); // would fall into the picture again
    const double farthest = 100 * edge * (1 - 0.4 * edge * edge);
    EXPECT_TRUE(folding.ray(50 + farthest - 0.01, 50));
    EXPECT_FALSE(folding.ray(50 + farthest + 0.01, 50));
    const Lens fisheye({100, 100, 50, 50, 100, 100, CameraModel::fisheye, {-0.2}});
    EXPECT_NEAR(fisheye.limit(), 1 / std::sqrt(0.6), 1e-9);
    EXPECT_FALSE(fisheye.project({1, 0, 0.1}));
    EXPECT_NEAR(Lens(fisheye_from_fov(360, 100, 100)).limit(), std::numbers::pi, 1e-12);
    // a denominator that becomes 0 at r = 2
    EXPECT_LT(Lens({100, 100, 50, 50, 100, 100, CameraModel::opencv, {0, 0, 0, 0, 0, -0.25}}).limit(), 2);
    // p1 turns the mapping over on one side first
    EXPECT_LT(Lens({100, 100, 50, 50, 100, 100, CameraModel::opencv, {-0.1, 0, 0.1}}).limit(), 1 / std::sqrt(0.3));
}

TEST(Lens, without_distortion_opencv_is_a_pinhole)
{
    Intrinsics k = pinhole_from_fov(90, 616, 424), opencv = k;
    opencv.model = CameraModel::opencv;
    EXPECT_EQ(simplified(opencv), k);
    for (const Point3& p : {Point3{0.3, 0.2, 1}, {-4, 2, 3}, {100, 1, 1}}) {
        EXPECT_NEAR(Lens(opencv).project(p)->x, Lens(k).project(p)->x, 1e-9);
        EXPECT_NEAR(Lens(opencv).project(p)->y, Lens(k).project(p)->y, 1e-9);
    }
    opencv.distortion[7] = 0.1;
    EXPECT_EQ(simplified(opencv), opencv);
}

TEST(Lens, a_scaled_lens_sees_the_same_edges)
{
    for (const Intrinsics& k : lenses()) {
        const Intrinsics half = scaled_to(k, k.width / 2, k.height / 4);
        EXPECT_TRUE(check_intrinsics(half, "half"));
        const auto a = Lens(k).project({0.3, -0.2, 1}), b = Lens(half).project({0.3, -0.2, 1});
        EXPECT_NEAR(a->x / 2, b->x, 1e-9);
        EXPECT_NEAR(a->y / 4, b->y, 1e-9);
    }
}

TEST(Lens, intrinsics_that_no_camera_has_are_told)
{
    const auto changed = [](Intrinsics k, auto change) {
        change(k);
        return check_intrinsics(k, "here");
    };
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    for (const Intrinsics& k : lenses())
        EXPECT_TRUE(check_intrinsics(k, "here"));
    EXPECT_TRUE(
        says(changed(kOpencv, [](auto& k) { k.distortion[1] = kNaN; }), "here: expected distortion coefficients"));
    EXPECT_TRUE(says(changed(kFisheye, [](auto& k) { k.distortion[0] = 1e9; }), "at most 1e+06, found 1000000000"));
    EXPECT_TRUE(says(changed(kFisheye, [](auto& k) { k.distortion[4] = 0.1; }),
                     "a camera of model fisheye has no distortion coefficient 5, found 0.1"));
    EXPECT_TRUE(says(changed(pinhole_from_fov(90, 8, 8), [](auto& k) { k.distortion[0] = 0.1; }),
                     "a camera of model pinhole has no distortion coefficient 1"));
    EXPECT_TRUE(
        says(changed(whole_sphere(8, 4), [](auto& k) { k.fx *= 2; }), "expected a panorama of the whole sphere"));
    EXPECT_TRUE(
        says(changed(whole_sphere(8, 4), [](auto& k) { k.cy += 1; }), "expected a panorama of the whole sphere"));
    EXPECT_TRUE(says(changed(kBackward, [](auto& k) { k.distortion[0] = 0; }), "a polynomial that does not rise at 0"));
    EXPECT_TRUE(says(changed(kForward, [](auto& k) { k.distortion[5] = 0; }), "linear_cde 0, 0.0015, -0.0007"));
    EXPECT_TRUE(says(changed(kForward, [](auto& k) { k.distortion[8] = 0; }), "expected a max_angle above 0"));
    EXPECT_TRUE(says(changed(kFisheye, [](auto& k) { k.fy = 0; }), "expected focal lengths above 0"));
    EXPECT_TRUE(says(changed(kFisheye, [](auto& k) { k.cx = kNaN; }), "is not finite"));
    EXPECT_TRUE(says(changed(kFisheye, [](auto& k) { k.width = 0; }), "an image of 0 x 960 pixels"));
}

TEST(Lens, models_have_names)
{
    for (const CameraModel model :
         {CameraModel::pinhole, CameraModel::opencv, CameraModel::fisheye, CameraModel::equirectangular})
        EXPECT_EQ(camera_model_of(name_of(model)), model);
    EXPECT_EQ(camera_model_of("ftheta"), CameraModel::ftheta);
    EXPECT_FALSE(camera_model_of("f-theta"));
}

TEST(Lens, depth_is_from_the_camera_where_z_cannot_tell)
{
    EXPECT_FALSE(Lens(fisheye_from_fov(120, 100, 10)).radial_depth());
    EXPECT_TRUE(Lens(fisheye_from_fov(190, 100, 10)).radial_depth());
    EXPECT_TRUE(Lens(fisheye_from_fov(150, 100, 100)).radial_depth()); // in the corners
    EXPECT_FALSE(Lens(kOpencv).radial_depth());
    EXPECT_TRUE(Lens(whole_sphere(8, 4)).radial_depth());
}

} // namespace engine_lens_test
} // namespace semrover
