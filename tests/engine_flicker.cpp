// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/flicker.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_flicker_test {

constexpr uint32_t kWidth = 40, kHeight = 24;

CameraFrame camera_at(double x, double z = 0)
{
    CameraFrame frame;
    frame.intrinsics = {30, 30, 20, 12, kWidth, kHeight};
    frame.pose.world_to_camera = {1, 0, 0, -x, 0, 1, 0, 0, 0, 0, 1, -z, 0, 0, 0, 1};
    return frame;
}

DepthPicture even_depth(uint32_t millimetres, uint32_t width = kWidth, uint32_t height = kHeight)
{
    return {width, height, std::vector<uint32_t>(size_t(width) * height, millimetres)};
}

ImageRgb8 random_image(uint32_t seed, uint32_t width = kWidth, uint32_t height = kHeight)
{
    std::mt19937 random(seed);
    ImageRgb8 image{width, height, std::vector<uint8_t>(size_t(width) * height * 3)};
    for (uint8_t& v : image.pixels)
        v = uint8_t(random());
    return image;
}

TEST(EngineFlicker, a_camera_that_stands_still_compares_every_pixel_with_itself)
{
    const Flow flow = flow_between(camera_at(0), even_depth(5000), camera_at(0), even_depth(5000));
    EXPECT_EQ(flow.with_depth, uint64_t(kWidth * kHeight));
    ImageRgb8 a = random_image(1), b = a;
    WarpSums same = warped_difference(flow, a, a);
    EXPECT_EQ(same.valid, same.pixels);
    EXPECT_NEAR(same.mean(), 0, 1e-6);
    for (size_t i = 0; i < a.pixels.size(); ++i) { // one of three channels by 9
        a.pixels[i] /= 2;
        b.pixels[i] = uint8_t(a.pixels[i] + (i % 3 == 1 ? 9 : 0));
    }
    const WarpSums off = warped_difference(flow, a, b);
    EXPECT_NEAR(off.mean(), 3, 1e-6);
    EXPECT_NEAR(off.rms(), std::sqrt(27), 1e-6);
    EXPECT_EQ(off.share(), 1);
}

TEST(EngineFlicker, a_wall_moves_by_focal_length_times_way_over_depth)
{
    // 0.4 m to the right of a wall at 5 m: 2.4 pixels
    const Flow flow = flow_between(camera_at(0), even_depth(5000), camera_at(0.4), even_depth(5000));
    ImageRgb8 from{kWidth, kHeight, {}}, to = from;
    for (uint32_t i = 0; i < kWidth * kHeight; ++i)
        for (uint32_t c = 0; c < 3; ++c) { // grows by 5 a pixel: what lies between pixels is known
            from.pixels.push_back(uint8_t(5 * (i % kWidth)));
            to.pixels.push_back(uint8_t(std::min(5 * (i % kWidth) + 12, 255u)));
        }
    uint64_t valid = 0;
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const Flow::Source& s = flow.sources[y * kWidth + x];
            ASSERT_EQ(s.valid(), x + 2.4 <= kWidth - 1) << x;
            if (!s.valid())
                continue;
            ++valid;
            EXPECT_NEAR(s.x, x + 0.5 + 2.4, 1e-9);
            EXPECT_NEAR(s.y, y + 0.5, 1e-9);
        }
    const WarpSums sums = warped_difference(flow, from, to);
    EXPECT_EQ(sums.valid, valid);
    EXPECT_NEAR(sums.mean(), 0, 1e-9);
    EXPECT_NEAR(sums.share(), double(valid) / (kWidth * kHeight), 1e-12);
}

// a card of 2 m at 4 m before a wall at 10 m, seen from (x, 0, z)
double depth_seen(double x, double z, double u, double v)
{
    const double a = (u - 20) / 30, b = (v - 12) / 30;
    const double near = 4 - z, far = 10 - z;
    return std::abs(x + a * near) <= 1 && std::abs(b * near) <= 1 ? near : far;
}

DepthPicture depth_of_card(double x, double z)
{
    DepthPicture depth{kWidth, kHeight, {}};
    for (uint32_t i = 0; i < kWidth * kHeight; ++i)
        depth.pixels.push_back(uint32_t(std::lround(1000 * depth_seen(x, z, i % kWidth + 0.5, i / kWidth + 0.5))));
    return depth;
}

TEST(EngineFlicker, what_was_hidden_before_or_lies_on_an_outline_is_left_out)
{
    const double step = 0.5, forward = 0.7;
    const DepthPicture before = depth_of_card(0, 0), after = depth_of_card(step, forward);
    const Flow flow = flow_between(camera_at(0), before, camera_at(step, forward), after);
    uint64_t hidden = 0, outside = 0, valid = 0;
    for (uint32_t i = 0; i < kWidth * kHeight; ++i) {
        // the point, and where it was
        const double z = after.pixels[i] / 1000.0;
        const double px = (i % kWidth + 0.5 - 20) / 30 * z + step, py = (i / kWidth + 0.5 - 12) / 30 * z;
        const double pz = z + forward, u = 30 * px / pz + 20, v = 30 * py / pz + 12;
        const int left = int(std::floor(u - 0.5)), top = int(std::floor(v - 0.5));
        if (left < 0 || top < 0 || left + 1 >= int(kWidth) || top + 1 >= int(kHeight)) {
            EXPECT_FALSE(flow.sources[i].valid()) << i;
            ++outside;
            continue;
        }
        int same = 0; // of four neighbours, those on the same of both surfaces
        for (int k = 0; k < 4; ++k)
            same += std::abs(before.pixels[size_t(top + k / 2) * kWidth + size_t(left + k % 2)] / 1000.0 - pz) < 1;
        if (same == 4) {
            ++valid;
            EXPECT_TRUE(flow.sources[i].valid()) << i;
        } else if (same == 0) {
            ++hidden;
            EXPECT_FALSE(flow.sources[i].valid()) << i;
        }
    }
    EXPECT_GT(valid, 300u); // the case is not empty
    EXPECT_GT(hidden, 10u);
    EXPECT_GT(outside, 10u);
    // a wall behind the card that is nearly as near agrees
    const Flow loose = flow_between(camera_at(0), before, camera_at(step, forward), after, {.tolerance = 1});
    size_t more = 0;
    for (size_t i = 0; i < flow.sources.size(); ++i) {
        EXPECT_TRUE(!flow.sources[i].valid() || loose.sources[i].valid());
        more += loose.sources[i].valid() && !flow.sources[i].valid();
    }
    EXPECT_GT(more, 0u);
}

TEST(EngineFlicker, a_slanting_road_agrees_with_itself_where_depth_grows_by_much_a_pixel)
{
    // the ground 1.5 m below a camera that drives 0.6 m: depth 45 / (v - 12), up to 40 m
    const auto road = [] {
        DepthPicture depth = even_depth(0);
        for (uint32_t i = 0; i < kWidth * kHeight; ++i)
            if (const double below = i / kWidth + 0.5 - 12; below > 1)
                depth.pixels[i] = uint32_t(std::lround(45000 / below));
        return depth;
    }();
    const Flow flow = flow_between(camera_at(0), road, camera_at(0, 0.6), road);
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const double below = y + 0.5 - 12;
            const double z = 45 / below + 0.6, v = 45 / z + 12, u = (x + 0.5 - 20) * (z - 0.6) / z + 20;
            const bool inside = below > 1 && v - 0.5 >= 13 && u >= 0.5 && u <= kWidth - 0.5; // rows 13 on have depth
            EXPECT_EQ(flow.sources[y * kWidth + x].valid(), inside) << x << " " << y;
        }
}

TEST(EngineFlicker, sky_has_no_flow)
{
    DepthPicture before = even_depth(5000), after = even_depth(5000);
    after.pixels[3] = 0;
    after.pixels[4] = 0;
    before.pixels[100] = 0;
    before.pixels[101] = 0;
    const Flow flow = flow_between(camera_at(0), before, camera_at(0), after);
    EXPECT_EQ(flow.with_depth, uint64_t(kWidth * kHeight - 2));
    for (size_t i = 0; i < flow.sources.size(); ++i)
        EXPECT_EQ(flow.sources[i].valid(), i != 3 && i != 4 && i != 100 && i != 101) << i;
    const WarpSums sums = warped_difference(flow, random_image(1), random_image(2));
    EXPECT_EQ(sums.valid, uint64_t(kWidth * kHeight - 4));
    EXPECT_EQ(WarpSums{}.mean(), 0);
    EXPECT_EQ(WarpSums{}.share(), 0);
}

TEST(EngineFlicker, a_panorama_that_turns_by_whole_pixels_is_the_same_picture_shifted)
{
    CameraFrame from, to;
    from.intrinsics = to.intrinsics = whole_sphere(64, 32);
    const double angle = 3 * 2 * 3.14159265358979323846 / 64; // to the right: 3 pixels
    to.pose.world_to_camera = {std::cos(angle), 0, -std::sin(angle), 0, 0, 1, 0, 0,
                               std::sin(angle), 0, std::cos(angle),  0, 0, 0, 0, 1};
    DepthPicture depth = even_depth(0, 64, 32);
    std::mt19937 random(4);
    for (uint32_t y = 0; y < 32; ++y)
        for (uint32_t x = 0; x < 64; ++x)
            depth.pixels[y * 64 + x] = uint32_t(4000 + random() % 9000);
    DepthPicture turned = depth;
    for (uint32_t y = 0; y < 32; ++y)
        for (uint32_t x = 0; x < 64; ++x)
            turned.pixels[y * 64 + x] = depth.pixels[y * 64 + (x + 3) % 64];
    const Flow flow = flow_between(from, depth, to, turned);
    for (uint32_t y = 0; y < 32; ++y)
        for (uint32_t x = 0; x < 61; ++x) {
            const Flow::Source& s = flow.sources[y * 64 + x];
            ASSERT_TRUE(s.valid()) << x << " " << y;
            EXPECT_NEAR(s.x, x + 3.5, 1e-6);
            EXPECT_NEAR(s.y, y + 0.5, 1e-6);
        }
}

} // namespace engine_flicker_test
} // namespace semrover
