// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
#include "engine/deferred/frame_history.h"
#include "tests/support/kernel_case.h"

namespace semrover {
namespace engine_frame_history_test {

const LatentSize kSize{56, 40, 8};
constexpr size_t kBytes = 56 * 40 * 3;

// a metre ahead of the last one; far from the origin, where fp32 has centimetres
CameraFrame camera(uint32_t number)
{
    CameraFrame c;
    c.intrinsics = pinhole_from_fov(80, kSize.image_width, kSize.image_height);
    c.pose.world_to_camera = inverse(Rigid{1, 0, 0, 250000, 0, 1, 0, 0, 0, 0, 1, 800000.0 + 0.25 * number});
    return c;
}

// a wall across the way
DepthPicture depth(uint32_t number)
{
    return {kSize.image_width, kSize.image_height, std::vector<uint32_t>(kBytes / 3, 12000 - 250 * number)};
}

// the wall's picture, seen from nearer every time, and noise
std::vector<uint8_t> pixels(uint32_t number)
{
    std::mt19937 random(number + 1);
    std::vector<uint8_t> bytes;
    const double scale = (12 - 0.25 * number) / 12;
    for (uint32_t y = 0; y < kSize.image_height; ++y)
        for (uint32_t x = 0; x < kSize.image_width; ++x)
            for (int c = 0; c < 3; ++c)
                bytes.push_back(
                    uint8_t(128 + 60 * std::sin(0.15 * scale * (x - 27.5) + c) + double(random() % 41) - 20));
    return bytes;
}

std::vector<uint8_t> bytes_of(const FrameHistory& history)
{
    auto bytes = *history.frame().read<uint8_t>(test_device());
    bytes.resize(kBytes);
    return bytes;
}

std::unique_ptr<FrameHistory> begin()
{
    auto history = FrameHistory::create(test_device(), kSize, CameraModel::pinhole, 0.6f);
    EXPECT_TRUE(history) << history.error().message;
    return std::move(*history);
}

template <typename Bytes>
void add(FrameHistory& history, const Bytes& bytes, const CameraFrame& camera, const DepthPicture& depth)
{
    const Status added = history.add(bytes, camera, depth);
    ASSERT_TRUE(added) << added.error().message;
    history.keep();
}

// off the wall's picture without noise, root mean square
double noise_of(const std::vector<uint8_t>& frame, uint32_t number)
{
    const double scale = (12 - 0.25 * number) / 12;
    double sum = 0;
    for (size_t i = 0; i < frame.size(); ++i) {
        const double x = double(i / 3 % kSize.image_width),
                     truth = 128 + 60 * std::sin(0.15 * scale * (x - 27.5) + double(i % 3));
        sum += (frame[i] - truth) * (frame[i] - truth);
    }
    return std::sqrt(sum / double(frame.size()));
}

TEST(engine_frame_history, keeps_the_first_frame_and_takes_noise_from_the_next_ones)
{
    const auto history = begin();
    add(*history, pixels(0), camera(0), depth(0));
    EXPECT_EQ(bytes_of(*history), pixels(0));
    for (uint32_t f = 1; f < 6; ++f)
        add(*history, pixels(f), camera(f), depth(f));
    // independent noise falls to (1 - a) / sqrt(1 - a^2) = 0.5 of its deviation; cutting leaves more of it
    EXPECT_NEAR(noise_of(pixels(5), 5), 11.8, 0.5);
    EXPECT_LT(noise_of(bytes_of(*history), 5), 8.5);
}

TEST(engine_frame_history, goes_on_from_a_restored_frame_to_the_same_bytes)
{
    const auto whole = begin(), second = begin();
    std::vector<uint8_t> third;
    for (uint32_t f = 0; f < 5; ++f) {
        add(*whole, pixels(f), camera(f), depth(f));
        if (f == 2)
            third = bytes_of(*whole);
    }
    add(*second, pixels(9), camera(9), depth(9)); // of another chain
    ASSERT_TRUE(second->restore(third, camera(2), depth(2)));
    for (uint32_t f = 3; f < 5; ++f)
        add(*second, pixels(f), camera(f), depth(f));
    EXPECT_EQ(bytes_of(*whole), bytes_of(*second));
}

TEST(engine_frame_history, what_is_not_kept_is_replaced)
{
    const auto whole = begin(), again = begin();
    for (uint32_t f = 0; f < 4; ++f) {
        add(*whole, pixels(f), camera(f), depth(f));
        CameraFrame wide = camera(7);
        wide.intrinsics.model = CameraModel::fisheye;
        ASSERT_TRUE(again->add(pixels(8), camera(8), depth(8)));
        ASSERT_TRUE(again->add(pixels(7), wide, depth(7)));
        add(*again, pixels(f), camera(f), depth(f));
    }
    EXPECT_EQ(bytes_of(*whole), bytes_of(*again));
}

TEST(engine_frame_history, takes_words_on_the_device_like_pixels_of_the_host)
{
    const auto host = begin(), device = begin();
    TensorPool state;
    const DeviceTensor words = state.tensor(kBytes / 4, 1, DType::u32, "decoded", 1);
    ASSERT_TRUE(state.allocate(test_device(), "test"));
    for (uint32_t f = 0; f < 3; ++f) {
        add(*host, pixels(f), camera(f), depth(f));
        ASSERT_TRUE(words.write(test_device(), pixels(f)));
        add(*device, words, camera(f), depth(f));
    }
    EXPECT_EQ(bytes_of(*host), bytes_of(*device));
}

TEST(engine_frame_history, begins_anew_behind_a_cut_and_behind_another_lens)
{
    const auto history = begin();
    add(*history, pixels(0), camera(0), depth(0));
    history->restart();
    add(*history, pixels(1), camera(1), depth(1));
    EXPECT_EQ(bytes_of(*history), pixels(1));
    CameraFrame wide = camera(2);
    wide.intrinsics.model = CameraModel::fisheye;
    add(*history, pixels(2), wide, depth(2));
    EXPECT_EQ(bytes_of(*history), pixels(2));
    add(*history, pixels(3), wide, depth(2));
    EXPECT_NE(bytes_of(*history), pixels(3));
}

} // namespace engine_frame_history_test
} // namespace semrover
