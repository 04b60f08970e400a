// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/annotation/projected_box.h"
#include "engine/camera/rig.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

namespace semrover {
namespace engine_projected_box_test {

constexpr double kNear = 0.2;

// the naive one: points all over the box' faces
std::optional<PictureBox> sampled(const Intrinsics& k, const PlacedBox& box, int steps)
{
    const Lens lens(k);
    std::optional<PictureBox> area;
    for (size_t axis = 0; axis < 3; ++axis)
        for (const double side : {-0.5, 0.5})
            for (int i = 0; i <= steps; ++i)
                for (int j = 0; j <= steps; ++j) {
                    Point3 p;
                    p[axis] = side * box.size[axis];
                    p[(axis + 1) % 3] = (double(i) / steps - 0.5) * box.size[(axis + 1) % 3];
                    p[(axis + 2) % 3] = (double(j) / steps - 0.5) * box.size[(axis + 2) % 3];
                    const Point3 at = transform(box.pose, p);
                    if ((k.model == CameraModel::pinhole || k.model == CameraModel::opencv) && at[2] < kNear)
                        continue;
                    const auto seen = lens.project(at);
                    if (!seen)
                        continue;
                    if (!area)
                        area = PictureBox{seen->x, seen->y, seen->x, seen->y};
                    area->left = std::min(area->left, seen->x);
                    area->right = std::max(area->right, seen->x);
                    area->top = std::min(area->top, seen->y);
                    area->bottom = std::max(area->bottom, seen->y);
                }
    return area;
}

Intrinsics lens_of(CameraModel model)
{
    if (model == CameraModel::fisheye) {
        Intrinsics k = fisheye_from_fov(190, 600, 600);
        k.distortion = {0.02, -0.01, 0.001, 0};
        return k;
    }
    if (model == CameraModel::equirectangular)
        return whole_sphere(1024, 512);
    Intrinsics k = pinhole_from_fov(80, 640, 400);
    k.model = model;
    if (model == CameraModel::opencv)
        k.distortion = {-0.28, 0.07, 1e-3, -5e-4, 0, 0, 0, 0};
    return k;
}

class Lenses : public testing::TestWithParam<CameraModel> {};

// boxes ahead at any angle; what a lens bends is within 0.02 pixels of what is sampled, which is never outside of it
TEST_P(Lenses, show_a_box_where_its_points_are)
{
    const Intrinsics k = lens_of(GetParam());
    const BoxProjection projection(k, kNear);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any(-1, 1);
    int seen = 0;
    double most = 0;
    for (int i = 0; i < 200; ++i) {
        const PlacedBox box{*rigid_from_quaternion(
                                {8 * any(random), 3 * any(random), 14 + 8 * any(random)},
                                [&] {
                                    Quaternion q{any(random), any(random), any(random), any(random)};
                                    const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
                                    for (double& v : q)
                                        v /= n;
                                    return q;
                                }(),
                                "box"),
                            {4.4 + 2 * any(random), 1.8 + any(random), 1.5 + any(random)}};
        const auto area = projection.amodal(box), naive = sampled(k, box, 160);
        ASSERT_EQ(area.has_value(), naive.has_value()) << i;
        if (!area)
            continue;
        ++seen;
        const double beyond[] = {naive->left - area->left, naive->top - area->top, area->right - naive->right,
                                 area->bottom - naive->bottom};
        for (const double d : beyond) {
            EXPECT_GT(d, -0.02) << i;
            most = std::max(most, d);
        }
    }
    EXPECT_GT(seen, 190);
    EXPECT_LT(most, GetParam() == CameraModel::pinhole ? 1e-6 : 0.05);
}

INSTANTIATE_TEST_SUITE_P(engine_projected_box, Lenses,
                         testing::Values(CameraModel::pinhole, CameraModel::opencv, CameraModel::fisheye,
                                         CameraModel::equirectangular));

TEST(engine_projected_box, is_cut_where_the_near_plane_is)
{
    const Intrinsics k = lens_of(CameraModel::pinhole);
    // from 1 m behind the camera to 9 m ahead, 1 to 3 m to the right
    const PlacedBox box{{1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1}, {2, 2, 10}};
    const BoxProjection projection(k, kNear);
    const auto area = projection.amodal(box);
    ASSERT_TRUE(area);
    EXPECT_NEAR(area->left, k.cx + k.fx * 1 / 9, 1e-9);
    EXPECT_NEAR(area->right, k.cx + k.fx * 3 / kNear, 1e-6);
    EXPECT_NEAR(area->top, k.cy - k.fy * 1 / kNear, 1e-6);
    const double share = (640 - area->left) * 400 / area->area();
    EXPECT_NEAR(projection.outside(*area), 1 - share, 1e-12);
    EXPECT_EQ(projection.inside(*area), (PictureBox{area->left, 0, 640, 400}));
    const PlacedBox behind{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -4, 0, 0, 0, 1}, {2, 2, 4}};
    EXPECT_FALSE(projection.amodal(behind));
}

TEST(engine_projected_box, ends_where_the_lens_ends)
{
    Intrinsics k = lens_of(CameraModel::opencv);
    k.distortion = {-0.3, 0, 1e-3, -5e-4, 0, 0, 0, 0};
    ASSERT_LT(Lens(k).limit(), 1.1);
    // a wall across all that the lens sees
    const PlacedBox wall{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1}, {60, 60, 1}};
    const auto area = BoxProjection(k, kNear).amodal(wall);
    ASSERT_TRUE(area);
    const auto naive = sampled(k, wall, 3000);
    EXPECT_NEAR(area->left, naive->left, 0.3);
    EXPECT_NEAR(area->right, naive->right, 0.3);
    EXPECT_NEAR(area->top, naive->top, 0.3);
    EXPECT_NEAR(area->bottom, naive->bottom, 0.3);
}

TEST(engine_projected_box, is_all_around_where_the_camera_is_inside)
{
    const PlacedBox room{kIdentity, {4, 4, 4}};
    const auto panorama = BoxProjection(whole_sphere(1024, 512), kNear).amodal(room);
    EXPECT_EQ(panorama, (PictureBox{0, 0, 1024, 512}));
    const Intrinsics k = lens_of(CameraModel::fisheye);
    const auto fisheye = BoxProjection(k, kNear).amodal(room);
    ASSERT_TRUE(fisheye);
    EXPECT_LT(fisheye->left, 0);
    EXPECT_GT(fisheye->bottom, 600);
    // behind a panorama's seam
    const PlacedBox behind{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -6, 0, 0, 0, 1}, {2, 2, 2}};
    const auto wide = BoxProjection(whole_sphere(1024, 512), kNear).amodal(behind);
    ASSERT_TRUE(wide);
    EXPECT_EQ(wide->left, 0);
    EXPECT_EQ(wide->right, 1024);
    EXPECT_NEAR(wide->top, 256 - 1024 / (2 * std::numbers::pi) * std::atan2(1, 5), 1e-9);
}

TEST(engine_projected_box, says_how_far_away_a_pixel_meets_it)
{
    const Intrinsics k = lens_of(CameraModel::pinhole);
    const PlacedBox box{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 10, 0, 0, 0, 1}, {2, 2, 4}};
    const BoxProjection projection(k, kNear);
    const auto middle = projection.depths(box, 320, 200);
    ASSERT_TRUE(middle);
    EXPECT_NEAR((*middle)[0], 8, 1e-9);
    EXPECT_NEAR((*middle)[1], 12, 1e-9);
    EXPECT_FALSE(projection.depths(box, 10, 10));
    // a panorama's depth is from the camera
    const auto away = BoxProjection(whole_sphere(1024, 512), kNear).depths(box, 527, 256);
    ASSERT_TRUE(away);
    const double azimuth = 15.5 * 2 * std::numbers::pi / 1024, elevation = 0.5 * std::numbers::pi / 512;
    EXPECT_NEAR((*away)[0], 8 / std::cos(azimuth) / std::cos(elevation), 1e-9);
}

} // namespace engine_projected_box_test
} // namespace semrover
