// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/deferred/noise_trail.h"

#include <gtest/gtest.h>
#include <set>

namespace semrover {
namespace engine_noise_trail_test {

const LatentSize kSize{64, 48, 4};

// looks along its z axis, which is the world's, from (x, y, z)
CameraFrame camera(double x, double y, double z, double turn = 0)
{
    CameraFrame c;
    c.intrinsics = pinhole_from_fov(90, kSize.image_width, kSize.image_height); // focal length 32 pixels
    const double s = std::sin(turn), k = std::cos(turn);                        // about the y axis
    const Rigid camera_to_world{k, 0, s, x, 0, 1, 0, y, -s, 0, k, z};
    c.pose.world_to_camera = inverse(camera_to_world);
    return c;
}

DepthPicture depth_of(uint32_t millimetres)
{
    return {kSize.image_width, kSize.image_height,
            std::vector<uint32_t>(size_t(kSize.image_width) * kSize.image_height, millimetres)};
}

uint32_t pixel(uint32_t column, uint32_t row)
{
    return row * kSize.width() + column;
}

size_t distinct(const NoiseTrail& trail)
{
    return std::set<NoiseKey>(trail.keys().begin(), trail.keys().end()).size();
}

size_t carried(const NoiseTrail& trail)
{
    return size_t(std::ranges::count_if(trail.keys(), [&](const NoiseKey& k) { return k.frame + 1 < trail.frames(); }));
}

TEST(engine_noise_trail, begins_with_every_pixel_its_own)
{
    NoiseTrail trail(kSize);
    trail.follow(camera(0, 0, 0), depth_of(8000));
    ASSERT_EQ(trail.keys().size(), kSize.pixels());
    for (uint32_t i = 0; i < kSize.pixels(); ++i)
        EXPECT_EQ(trail.keys()[i], (NoiseKey{i, 0}));
}

// the camera goes 1 m to the right, 8 m from a wall, in the time in which a picture is read out: lines of the first
// frame are as far apart as those of the second, so keys stay where they are; from a still frame the last lines are a
// pixel off, the first ones not
TEST(engine_noise_trail, follows_the_lines_of_a_rolling_shutter)
{
    const auto rolling = [&](double from, double to) {
        CameraFrame c = camera(from, 0, 0);
        c.readout = Readout{ShutterDirection::down, c.pose, camera(to, 0, 0).pose};
        return c;
    };
    NoiseTrail trail(kSize);
    trail.follow(rolling(0, 1), depth_of(8000));
    trail.follow(rolling(0, 1), depth_of(8000));
    for (uint32_t i = 0; i < kSize.pixels(); ++i)
        EXPECT_EQ(trail.keys()[i], (NoiseKey{i, 0})) << i;
    NoiseTrail from_still(kSize);
    from_still.follow(camera(0, 0, 0), depth_of(8000));
    from_still.follow(rolling(0, 1), depth_of(8000));
    const uint32_t last = kSize.height() - 1;
    EXPECT_EQ(from_still.keys()[pixel(3, 0)], (NoiseKey{pixel(3, 0), 0}));
    EXPECT_EQ(from_still.keys()[pixel(3, last)], (NoiseKey{pixel(4, last), 0}));
}

TEST(engine_noise_trail, stays_on_a_wall_that_moves_past)
{
    NoiseTrail trail(kSize);
    trail.follow(camera(0, 0, 0), depth_of(8000));
    trail.follow(camera(1, 0, 0), depth_of(8000)); // a metre to the right: 8 m away, 4 pixels, one of the latent
    for (uint32_t row = 0; row < kSize.height(); ++row) {
        for (uint32_t column = 0; column + 1 < kSize.width(); ++column)
            EXPECT_EQ(trail.keys()[pixel(column, row)], (NoiseKey{pixel(column + 1, row), 0}));
        const uint32_t last = pixel(kSize.width() - 1, row);
        EXPECT_EQ(trail.keys()[last], (NoiseKey{last, 1})); // came into view
    }
    trail.follow(camera(0, 0, 0), depth_of(8000)); // and back
    EXPECT_EQ(trail.keys()[pixel(5, 5)], (NoiseKey{pixel(5, 5), 0}));
    EXPECT_EQ(trail.keys()[pixel(0, 5)], (NoiseKey{pixel(0, 5), 2})); // forgotten when it was out of sight
}

TEST(engine_noise_trail, what_has_no_depth_is_infinitely_far_away)
{
    NoiseTrail trail(kSize);
    trail.follow(camera(0, 0, 0), depth_of(0));
    trail.follow(camera(3, 1, 2), depth_of(0));
    EXPECT_EQ(carried(trail), kSize.pixels());
    EXPECT_EQ(trail.keys()[pixel(7, 3)], (NoiseKey{pixel(7, 3), 0}));
    // to the right by a latent pixel at the centre: tan = 4 / 32
    trail.follow(camera(3, 1, 2, std::atan(0.125)), depth_of(0));
    EXPECT_EQ(trail.keys()[pixel(8, 6)], (NoiseKey{pixel(9, 6), 0}));
}

TEST(engine_noise_trail, depth_in_another_unit_is_the_same_depth)
{
    NoiseTrail millimetres(kSize), centimetres(kSize);
    for (uint32_t i = 0; i < 4; ++i) {
        DepthPicture depth = depth_of(800 - 90 * i);
        depth.unit = 0.01;
        millimetres.follow(camera(0.2 * i, 0.1, 0.9 * i), depth_of(8000 - 900 * i));
        centimetres.follow(camera(0.2 * i, 0.1, 0.9 * i), depth);
    }
    EXPECT_TRUE(std::ranges::equal(millimetres.keys(), centimetres.keys()));
    EXPECT_LT(carried(millimetres), kSize.pixels());
}

TEST(engine_noise_trail, no_noise_is_used_twice)
{
    NoiseTrail nearer(kSize), farther(kSize);
    for (int i = 0; i < 6; ++i) {
        nearer.follow(camera(0.2 * i, 0.1, 0.9 * i), depth_of(uint16_t(8000 - 900 * i)));
        farther.follow(camera(0.2 * i, 0.1, -0.9 * i, 0.05 * i), depth_of(uint16_t(8000 + 900 * i)));
        EXPECT_EQ(distinct(nearer), kSize.pixels());
        EXPECT_EQ(distinct(farther), kSize.pixels());
    }
    // half as far away, a wall is four times as large: a quarter of the picture at most has noise of the first frame
    const auto first = std::ranges::count_if(nearer.keys(), [](const NoiseKey& k) { return k.frame == 0; });
    EXPECT_LE(size_t(first), kSize.pixels() / 4);
    EXPECT_GT(size_t(first), kSize.pixels() / 16);
    EXPECT_GT(carried(nearer), kSize.pixels() / 2);
}

TEST(engine_noise_trail, of_several_pixels_the_nearest_inherits)
{
    NoiseTrail trail(kSize);
    trail.follow(camera(0, 0, 0), depth_of(8000));
    trail.follow(camera(0, 0, 4), depth_of(4000)); // twice as large about the centre, (8, 6) of the latent
    // pixel centres at 8.5 + n were at 8.25 + n / 2: of two that fall on one pixel both are as near, the first inherits
    EXPECT_EQ(trail.keys()[pixel(8, 6)], (NoiseKey{pixel(8, 6), 0}));
    EXPECT_EQ(trail.keys()[pixel(9, 6)], (NoiseKey{pixel(9, 6), 1}));
    EXPECT_EQ(trail.keys()[pixel(10, 6)], (NoiseKey{pixel(9, 6), 0}));
}

TEST(engine_noise_trail, what_was_behind_the_camera_is_new)
{
    NoiseTrail trail(kSize);
    trail.follow(camera(0, 0, 0), depth_of(1000));
    trail.follow(camera(0, 0, -5), depth_of(1000)); // a surface that the first camera had behind it
    EXPECT_EQ(carried(trail), 0u);
}

} // namespace engine_noise_trail_test
} // namespace semrover
