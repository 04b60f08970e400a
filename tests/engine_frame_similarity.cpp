// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "tools/eval/frame_similarity.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_frame_similarity_test {

ImageRgb8 random_image(uint32_t width, uint32_t height, uint32_t seed, uint32_t step = 1)
{
    std::mt19937 random(seed);
    ImageRgb8 image{width, height, std::vector<uint8_t>(size_t(width) * height * 3)};
    for (uint8_t& v : image.pixels)
        v = uint8_t(random() % 256 / step * step);
    return image;
}

ImageRgb8 filled(uint32_t width, uint32_t height, uint8_t value)
{
    return {width, height, std::vector<uint8_t>(size_t(width) * height * 3, value)};
}

double luma(const ImageRgb8& image, uint32_t x, uint32_t y)
{
    const uint8_t* p = &image.pixels[3 * (size_t(y) * image.width + x)];
    return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
}

// equation 13 of the paper, with the whole window of two dimensions and the variances around the means
double naive_ssim(const ImageRgb8& a, const ImageRgb8& b, uint32_t left, uint32_t top)
{
    double weights[11][11], sum = 0;
    for (int i = 0; i < 11; ++i)
        for (int j = 0; j < 11; ++j)
            sum += weights[i][j] = std::exp(-((i - 5) * (i - 5) + (j - 5) * (j - 5)) / (2 * 1.5 * 1.5));
    const auto mean = [&](auto&& value) {
        double m = 0;
        for (uint32_t i = 0; i < 11; ++i)
            for (uint32_t j = 0; j < 11; ++j)
                m += weights[i][j] / sum * value(left + j, top + i);
        return m;
    };
    const double ma = mean([&](uint32_t x, uint32_t y) { return luma(a, x, y); });
    const double mb = mean([&](uint32_t x, uint32_t y) { return luma(b, x, y); });
    const double va = mean([&](uint32_t x, uint32_t y) { return std::pow(luma(a, x, y) - ma, 2); });
    const double vb = mean([&](uint32_t x, uint32_t y) { return std::pow(luma(b, x, y) - mb, 2); });
    const double ab = mean([&](uint32_t x, uint32_t y) { return (luma(a, x, y) - ma) * (luma(b, x, y) - mb); });
    const double c1 = std::pow(0.01 * 255, 2), c2 = std::pow(0.03 * 255, 2);
    return (2 * ma * mb + c1) * (2 * ab + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

TEST(EngineFrameSimilarity, ssim_matches_the_formula_with_the_whole_window)
{
    for (const auto& [width, height] : {std::pair{11u, 11u}, {12u, 17u}, {40u, 23u}, {64u, 64u}, {11u, 90u}}) {
        SCOPED_TRACE(fmt::format("{} x {}", width, height));
        const ImageRgb8 a = random_image(width, height, 1, 40);
        ImageRgb8 b = random_image(width, height, 2, 100);
        for (size_t i = 0; i < b.pixels.size(); i += 2)
            b.pixels[i] = a.pixels[i];
        const std::vector<double> map = ssim_map(a, b);
        ASSERT_EQ(map.size(), size_t(width - 10) * (height - 10));
        for (uint32_t y = 0; y + 10 < height; ++y)
            for (uint32_t x = 0; x + 10 < width; ++x)
                ASSERT_NEAR(map[y * (width - 10) + x], naive_ssim(a, b, x, y), 1e-10) << x << " " << y;
    }
    EXPECT_TRUE(ssim_map(random_image(10, 40, 1), random_image(10, 40, 2)).empty());
}

TEST(EngineFrameSimilarity, equal_pictures_and_even_ones_are_known)
{
    const ImageRgb8 a = random_image(30, 20, 3);
    const FrameSimilarity same = frame_similarity(a, a);
    EXPECT_TRUE(std::isinf(same.all.psnr()));
    EXPECT_NEAR(same.all.ssim(), 1, 1e-12);
    const FrameSimilarity even = frame_similarity(filled(20, 12, 100), filled(20, 12, 110));
    EXPECT_NEAR(even.all.psnr(), 20 * std::log10(25.5), 1e-12);
    EXPECT_NEAR(even.all.ssim(), (2 * 100 * 110 + 6.5025) / (100 * 100 + 110 * 110 + 6.5025), 1e-9);
    EXPECT_EQ(even.all.pixels, 240u);
    EXPECT_EQ(even.all.windows, 20u);
    ImageRgb8 one = filled(20, 12, 100); // one channel of one pixel: 255^2 * 720 / 30^2
    one.pixels[77] = 130;
    EXPECT_NEAR(frame_similarity(one, filled(20, 12, 100)).all.psnr(), 10 * std::log10(65025. * 720 / 900), 1e-12);
}

TEST(EngineFrameSimilarity, which_picture_is_the_truth_and_which_way_up_does_not_matter)
{
    const ImageRgb8 a = random_image(33, 21, 5, 60), b = random_image(33, 21, 6, 60);
    const auto turned = [](ImageRgb8 image) {
        for (size_t i = 0; i < image.pixels.size() / 2; ++i) // by 180 degrees, channels too where they are equal
            std::swap(image.pixels[i], image.pixels[image.pixels.size() - 1 - i]);
        return image;
    };
    const auto gray = [](ImageRgb8 image) {
        for (size_t i = 0; i < image.pixels.size(); ++i)
            image.pixels[i] = image.pixels[i / 3 * 3];
        return image;
    };
    const FrameSimilarity ab = frame_similarity(gray(a), gray(b)), ba = frame_similarity(gray(b), gray(a));
    const FrameSimilarity around = frame_similarity(turned(gray(a)), turned(gray(b)));
    EXPECT_EQ(ab.all.psnr(), ba.all.psnr());
    EXPECT_NEAR(ab.all.ssim(), ba.all.ssim(), 1e-12);
    EXPECT_NEAR(ab.all.ssim(), around.all.ssim(), 1e-12);
}

TEST(EngineFrameSimilarity, more_noise_and_more_blur_are_less_alike)
{
    ImageRgb8 truth = filled(64, 64, 0);
    for (size_t i = 0; i < truth.pixels.size(); ++i) // tiles
        truth.pixels[i] = ((i / 3 % 64 / 8 + i / 192 / 8) % 2) ? 220 : 40;
    double last = 1;
    for (const int amount : {4, 16, 64}) {
        ImageRgb8 noisy = truth;
        std::mt19937 random(1);
        for (uint8_t& v : noisy.pixels)
            v = uint8_t(std::clamp(v + int(random() % uint32_t(2 * amount + 1)) - amount, 0, 255));
        const double ssim = frame_similarity(noisy, truth).all.ssim();
        EXPECT_LT(ssim, last);
        last = ssim;
    }
    last = 1;
    for (const size_t reach : {1, 2, 4}) {
        ImageRgb8 blurred = truth;
        for (size_t i = 3 * reach; i + 3 * reach < truth.pixels.size(); ++i) {
            size_t sum = 0;
            for (size_t k = 0; k <= 2 * reach; ++k)
                sum += truth.pixels[i - 3 * reach + 3 * k];
            blurred.pixels[i] = uint8_t(sum / (2 * reach + 1));
        }
        const double ssim = frame_similarity(blurred, truth).all.ssim();
        EXPECT_LT(ssim, last);
        last = ssim;
    }
}

TEST(EngineFrameSimilarity, masks_and_classes_share_the_pixels_out)
{
    const ImageRgb8 truth = filled(30, 20, 90);
    ImageRgb8 frame = truth;
    std::vector<uint8_t> visible(600, 127), labels(600, 255);
    for (size_t y = 0; y < 20; ++y)
        for (size_t x = 0; x < 30; ++x) {
            const size_t i = 30 * y + x;
            visible[i] = x < 10 ? 128 : 127;
            labels[i] = x < 10 ? 2 : y < 10 ? 19 : 20;
            for (size_t c = 0; c < 3; ++c)
                frame.pixels[3 * i + c] = x < 10 ? 100 : y < 10 ? 95 : 90;
        }
    const FrameSimilarity s = frame_similarity(frame, truth, {visible, labels, {}});
    EXPECT_EQ(s.visible.pixels, 200u);
    EXPECT_EQ(s.hidden.pixels, 400u);
    EXPECT_NEAR(s.visible.psnr(), 20 * std::log10(25.5), 1e-12);
    EXPECT_NEAR(s.hidden.psnr(), 10 * std::log10(65025 / 12.5), 1e-12);
    EXPECT_EQ(s.labels[2].squares, s.visible.squares);
    EXPECT_NEAR(s.labels[19].psnr(), 20 * std::log10(51), 1e-12);
    EXPECT_EQ(s.labels[20].pixels, 200u); // of no class
    EXPECT_TRUE(std::isinf(s.labels[20].psnr()));
    EXPECT_EQ(s.visible.windows, 5u * 10); // middles from (5, 5) on
    EXPECT_EQ(s.visible.windows + s.hidden.windows, s.all.windows);
    FrameSimilarity twice = s;
    twice += s;
    EXPECT_EQ(twice.all.psnr(), s.all.psnr());
    EXPECT_EQ(twice.labels[19].pixels, 2 * s.labels[19].pixels);
}

// luma = slope * x, gray
ImageRgb8 ramp(uint32_t width, uint32_t height, uint32_t slope)
{
    ImageRgb8 image = filled(width, height, 0);
    for (size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = uint8_t(slope * (i / 3 % width));
    return image;
}

TEST(EngineFrameSimilarity, sharpness_is_the_share_of_gradients)
{
    const ImageRgb8 truth = ramp(30, 20, 4), twice = ramp(30, 20, 8);
    EXPECT_NEAR(frame_similarity(truth, truth).all.sharpness(), 1, 1e-12);
    EXPECT_NEAR(frame_similarity(twice, truth).all.sharpness(), 2, 1e-12);
    EXPECT_NEAR(frame_similarity(truth, twice).all.sharpness(), 0.5, 1e-12);
    // 18 x 28 pixels are not on the rim; Sobel's weights see eight times the slope
    EXPECT_NEAR(frame_similarity(truth, twice).all.gradients, 18 * 28 * 32. * 32, 1e-6);
    EXPECT_TRUE(std::isnan(frame_similarity(filled(30, 20, 7), filled(30, 20, 9)).all.sharpness()));
}

TEST(EngineFrameSimilarity, distances_share_the_pixels_that_have_a_depth)
{
    const ImageRgb8 truth = ramp(40, 20, 4);
    ImageRgb8 frame = truth;
    std::vector<float> depth(800);
    std::vector<uint8_t> labels(800);
    for (size_t i = 0; i < 800; ++i) {
        const size_t x = i % 40;
        depth[i] = x < 5 ? 0.f : x < 10 ? 5.9f : x < 20 ? 6.f : x < 30 ? 24.9f : 25.f;
        labels[i] = x % 2 ? 19 : 255;
        for (size_t c = 0; c < 3; ++c)
            frame.pixels[3 * i + c] = uint8_t(x < 20 ? 4 * x : x < 30 ? 80 : 8 * x - 160); // flat, then twice as steep
    }
    const FrameSimilarity s = frame_similarity(frame, truth, {{}, labels, depth});
    const auto pixels = [&](size_t range) { return s.distances[range][19].pixels + s.distances[range][20].pixels; };
    EXPECT_EQ(pixels(0), 100u);
    EXPECT_EQ(pixels(1), 200u);
    EXPECT_EQ(pixels(2), 200u);
    EXPECT_EQ(pixels(3), 200u);
    EXPECT_EQ(s.distances[1][19].pixels, 100u);
    EXPECT_NEAR(s.distances[0][20].sharpness(), 1, 1e-12);
    EXPECT_LT(s.distances[2][20].sharpness(), 0.5);
    EXPECT_GT(s.distances[3][20].sharpness(), 1.8);
}

} // namespace engine_frame_similarity_test
} // namespace semrover
