// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// ops between pictures and networks: to the bit what the host does, which writes and reads the same pictures as files
#include "kernels/picture.h"

#include "engine/deferred/frame_codec.h"
#include "engine/deferred/frame_images.h"
#include "tests/frame_pixels_reference.h"
#include "tests/kernel_case.h"

#include <bit>
#include <cmath>

namespace semrover {
namespace kernel_picture_test {

constexpr PictureShape kShapes[] = {{1, 1, 8, 8}, {51, 38, 56, 40}, {64, 48, 64, 48}, {3, 130, 4, 132}};

uint32_t blocks_of(const PictureShape& s, uint32_t block)
{
    return s.padded_width / block * (s.padded_height / block);
}

// numbers as blending makes them, and those beside which a byte changes
SplatImage random_image(uint32_t width, uint32_t height, uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(0, 1);
    SplatImage image{.width = width, .height = height};
    for (uint32_t i = 0; i < width * height; ++i) {
        const float alpha = i % 7 == 0 ? float(i % 2) : unit(random);
        for (int c = 0; c < 3; ++c) {
            image.color.push_back(i % 5 == 0 ? (float(random() % 256) + 0.5f) / 255 : alpha * unit(random) * 1.01f);
            image.normal.push_back(i % 11 == 0 ? 0.f : alpha * (2 * unit(random) - 1));
        }
        image.alpha.push_back(alpha);
        image.depth_expected.push_back(i % 13 == 0 ? 70 * unit(random) : (float(random() % 60000) + 0.5f) / 1000);
        image.label.push_back(i % 3 ? random() % 20 : SplatImage::kNothing);
        image.visible.push_back(alpha >= 0.5f);
    }
    return image;
}

SplatImages on_device(KernelCase& k, const SplatImage& image)
{
    std::vector<float> color, surface, depth;
    std::vector<uint32_t> ids;
    for (size_t i = 0; i < image.alpha.size(); ++i) {
        color.insert(color.end(), {image.color[3 * i], image.color[3 * i + 1], image.color[3 * i + 2], image.alpha[i]});
        surface.insert(surface.end(), {image.normal[3 * i], image.normal[3 * i + 1], image.normal[3 * i + 2], 0});
        depth.insert(depth.end(), {image.depth_expected[i], 0});
        ids.insert(ids.end(), {image.label[i], 5});
    }
    return {k.input(color, 4), k.input(surface, 4), k.input(depth, 2), k.input(ids, 2), {}, {}};
}

TEST(kernel_picture, splats_become_the_bytes_that_files_of_them_hold)
{
    for (const std::array<uint8_t, 3> background : {std::array<uint8_t, 3>{0, 0, 0}, {255, 128, 3}}) {
        KernelCase k(test_device());
        const SplatImage image = random_image(251, 133, background[0] + 1);
        const PixelWords y = splat_pixels(k.graph, on_device(k, image), {background, 0.5f});
        const uint32_t pixels = image.width * image.height;
        const auto keep = [&](const Tensor& t) { return k.graph.keep(t, k.output(pixels, 1, DType::u32, 1)); };
        const Tensor seen = keep(y.seen), ranges = keep(y.ranges), normals = keep(y.normals);
        const Status status = k.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const auto got_seen = k.read_array<uint32_t>(seen), got_ranges = k.read_array<uint32_t>(ranges),
                   got_normals = k.read_array<uint32_t>(normals);
        const auto color = color_pixels(image, background), normal = normal_pixels(image), label = label_pixels(image),
                   visible = visible_pixels(image);
        const auto depth = depth_pixels(image);
        for (uint32_t i = 0; i < pixels; ++i) {
            for (uint32_t c = 0; c < 3; ++c) {
                ASSERT_EQ(got_seen[i] >> 8 * c & 255, color[3 * i + c]) << i;
                ASSERT_EQ(got_normals[i] >> 8 * c & 255, normal[3 * i + c]) << i;
            }
            ASSERT_EQ(got_seen[i] >> 24, visible[i]) << i;
            ASSERT_EQ(got_ranges[i] & 0xffff, depth[i]) << i;
            ASSERT_EQ(got_ranges[i] >> 16, label[i]) << i;
        }
    }
}

TEST(kernel_picture, bytes_become_the_numbers_that_a_network_is_given)
{
    for (const PictureShape& s : kShapes) {
        KernelCase k(test_device());
        std::vector<uint32_t> seen(s.width * s.height);
        for (size_t i = 0; i < seen.size(); ++i)
            seen[i] = uint32_t(i * 2654435761u);
        const FeatureMap y = picture_input(k.graph, k.input(seen), s);
        ASSERT_EQ(y.width, s.padded_width);
        ASSERT_EQ(y.height, s.padded_height);
        const HostMatrix got = k.run(y.data);
        k.expect_zero_padding(got);
        for (uint32_t row = 0; row < got.rows; ++row)
            for (uint32_t c = 0; c < 3; ++c) {
                const uint32_t x = std::min(row % s.padded_width, s.width - 1),
                               line = std::min(row / s.padded_width, s.height - 1);
                const auto byte = uint8_t(seen[line * s.width + x] >> 8 * c);
                const float expected = row < y.pixels() ? float(byte) / 127.5f - 1 : 0;
                ASSERT_EQ(got.at(row, c), expected) << "row " << row << " channel " << c;
            }
    }
}

TEST(kernel_picture, a_block_counts_its_visible_pixels)
{
    for (const PictureShape& s : kShapes)
        for (const uint32_t block : {4u, 1u, 2u}) {
            KernelCase k(test_device());
            std::vector<uint32_t> seen(s.width * s.height);
            std::vector<uint8_t> visible;
            for (size_t i = 0; i < seen.size(); ++i) {
                seen[i] = uint32_t(i * 2654435761u) >> 8 | (i * i % 7 < 3 ? 0xff000000u : 0);
                visible.push_back(uint8_t(seen[i] >> 24));
            }
            const Tensor out = k.output(round_up(blocks_of(s, block), kImageRowPadding), 1, DType::f32, 1);
            k.graph.keep(block_shares(k.graph, k.input(seen), s, block), out);
            ASSERT_TRUE(k.compile_and_run());
            auto expected = block_shares({s.padded_width, s.padded_height, block}, [&] {
                std::vector<uint8_t> all;
                for (uint32_t y = 0; y < s.padded_height; ++y)
                    for (uint32_t x = 0; x < s.padded_width; ++x)
                        all.push_back(visible[std::min(y, s.height - 1) * s.width + std::min(x, s.width - 1)]);
                return all;
            }());
            expected.resize(out.rows);
            EXPECT_EQ(k.read_array<float>(out), expected) << s.width << " in blocks of " << block;
        }
}

TEST(kernel_picture, latents_are_scaled_and_back_as_on_the_host)
{
    for (const auto& [factor, shift] : {std::pair{0.18215f, 0.f}, {0.3611f, 0.1159f}, {1.f, -3.f}, {13.7f, 0.5f}})
        for (const bool back : {false, true}) {
            KernelCase k(test_device());
            const HostMatrix x = k.random(9008, 8, DType::f32, 3);
            const HostMatrix y = k.run(scale_latent(k.graph, k.input(x), 9001, 5, {factor, shift, back}));
            ASSERT_EQ(y.cols, 5u);
            k.expect_zero_padding(y);
            for (uint32_t row = 0; row < y.rows; ++row)
                for (uint32_t c = 0; c < y.cols; ++c) {
                    const float v = back ? x.at(row, c) / factor + shift : (x.at(row, c) - shift) * factor;
                    ASSERT_EQ(y.at(row, c), row < 9001 ? v : 0) << "row " << row << " factor " << factor;
                }
        }
}

TEST(kernel_picture, numbers_become_the_bytes_of_a_picture)
{
    for (const PictureShape& s : kShapes) {
        KernelCase k(test_device());
        const uint32_t rows = round_up(s.padded_width * s.padded_height, kImageRowPadding);
        HostMatrix x = k.random(rows, 3, DType::f32, 0.8f);
        for (uint32_t r = 0; r < rows; r += 3) // where a byte changes, and what is cut
            x.set(r, r % 2, r % 5 ? (float(r % 256) + 0.5f) / 127.5f - 1 : 3.f * (r % 2 ? -1 : 1));
        const Tensor out = k.output(picture_words(s.width, s.height), 1, DType::u32, 1);
        k.graph.keep(picture_bytes(k.graph, k.input(x), s), out);
        ASSERT_TRUE(k.compile_and_run());
        std::vector<uint8_t> expected;
        for (uint32_t i = 0; i < s.width * s.height; ++i)
            for (uint32_t c = 0; c < 3; ++c) { // in floats, as the kernel's halves are those of floats
                const auto v = float(x.at(i / s.width * s.padded_width + i % s.width, c));
                expected.push_back(uint8_t(std::lround(std::clamp((v + 1) * 127.5f, 0.f, 255.f))));
            }
        expected.resize(out.rows * 4ull); // zeros fill the last word
        EXPECT_EQ(k.read_array<uint8_t>(out), expected) << s.width;
    }
}

TEST(kernel_picture, bytes_become_texels)
{
    for (const uint32_t pixels : {1u, 2u, 3u, 4u, 5u, 64u, 51u * 38}) {
        KernelCase k(test_device());
        std::vector<uint32_t> words(picture_words(pixels, 1));
        for (size_t i = 0; i < words.size(); ++i)
            words[i] = uint32_t((i + 1) * 2654435761u);
        const Tensor out = k.output(pixels, 1, DType::u32, 1);
        k.graph.keep(picture_texels(k.graph, k.input(words), pixels), out);
        ASSERT_TRUE(k.compile_and_run());
        const auto got = k.read_array<uint32_t>(out);
        const auto byte_of = [&](uint32_t n) { return words[n / 4] >> 8 * (n % 4) & 255; };
        for (uint32_t i = 0; i < pixels; ++i)
            ASSERT_EQ(got[i], byte_of(3 * i) | byte_of(3 * i + 1) << 8 | byte_of(3 * i + 2) << 16 | 255u << 24)
                << i << " of " << pixels;
    }
}

TEST(kernel_picture, finds_the_first_number_that_is_none)
{
    const PictureShape s{51, 38, 56, 40};
    for (const auto& [at, wrong] : {std::pair{~0u, 0.f},
                                    {0u, std::numeric_limits<float>::infinity()},
                                    {51 * 38 * 4 - 1u, std::numeric_limits<float>::quiet_NaN()},
                                    {5000u, -std::numeric_limits<float>::infinity()}}) {
        KernelCase k(test_device());
        HostMatrix x = k.random(56 * 40, 4, DType::f32);
        x.set(53, 2, std::numeric_limits<float>::quiet_NaN()); // beyond the picture's own columns
        x.set(39 * 56, 2, std::numeric_limits<float>::quiet_NaN());
        const auto spoil = [&](uint32_t element) {
            const uint32_t pixel = element / 4;
            x.set(pixel / 51 * 56 + pixel % 51, element % 4, wrong);
        };
        if (at != ~0u) {
            spoil(at);
            spoil(51 * 38 * 4 - 1);
        }
        const Tensor out = k.output(1, 1, DType::u32, 1);
        k.graph.keep(first_non_finite(k.graph, k.input(x), s), out);
        ASSERT_TRUE(k.compile_and_run());
        EXPECT_EQ(k.read_array<uint32_t>(out)[0], at);
    }
}

} // namespace kernel_picture_test
} // namespace semrover
