// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// ops between pictures and networks: to the bit what the host does, which writes and reads the same pictures as files
#include "kernels/picture.h"

#include "engine/deferred/frame_codec.h"
#include "engine/deferred/frame_images.h"
#include "tests/support/frame_pixels_reference.h"
#include "tests/support/kernel_case.h"

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
    return {k.input(color, 4), k.input(surface, 4), k.input(depth, 2), k.input(ids, 2), {}, {}, {}};
}

TEST(kernel_picture, splats_become_the_bytes_that_files_of_them_hold)
{
    struct Case {
        std::array<uint8_t, 3> background;
        float depth_units;
    };
    for (const auto& [background, units] :
         {Case{{0, 0, 0}, 1000}, Case{{255, 128, 3}, 1000}, Case{{0, 9, 0}, 100}, Case{{1, 1, 1}, 256}, Case{{}, 0}}) {
        KernelCase k(test_device());
        SplatImage image = random_image(251, 133, background[0] + 1);
        if (units != 1000) // beyond what millimetres hold, and what the units do
            for (float& depth : image.depth_expected)
                depth *= 12;
        const PixelWords y = splat_pixels(k.graph, on_device(k, image), {background, 0.5f, units});
        const uint32_t pixels = image.width * image.height;
        const auto keep = [&](const Tensor& t) { return k.graph.keep(t, k.output(pixels, 1, DType::u32, 1)); };
        const Tensor seen = keep(y.seen), depths = keep(y.depths), normals = keep(y.normals);
        const Status status = k.compile_and_run();
        ASSERT_TRUE(status) << status.error().message;
        const auto got_seen = k.read_array<uint32_t>(seen), got_depths = k.read_array<uint32_t>(depths),
                   got_normals = k.read_array<uint32_t>(normals);
        const auto color = color_pixels(image, background), normal = normal_pixels(image), label = label_pixels(image),
                   visible = visible_pixels(image);
        const auto depth = depth_pixels(image, units);
        for (uint32_t i = 0; i < pixels; ++i) {
            for (uint32_t c = 0; c < 3; ++c) {
                ASSERT_EQ(got_seen[i] >> 8 * c & 255, color[3 * i + c]) << i;
                ASSERT_EQ(got_normals[i] >> 8 * c & 255, normal[3 * i + c]) << i;
            }
            ASSERT_EQ(got_seen[i] >> 24, visible[i]) << i;
            ASSERT_EQ(got_depths[i], units > 0 ? depth[i] : std::bit_cast<uint32_t>(image.depth_expected[i])) << i;
            ASSERT_EQ(got_normals[i] >> 24, label[i]) << i;
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

// numbers that formats cut, those beside which they round in another way, and others
std::vector<float> texel_numbers(size_t count, uint32_t seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(-1.2f, 1.2f);
    const float hard[] = {0,     -0.f,     1,       -1,       2,      65519.9f,   65520,       -70000,    1e-8f,
                          3e-8f, 2.98e-8f, 6.1e-5f, 2.5e-45f, 1e-38f, 0.5f / 255, -0.5f / 127, 1 - 6e-8f, 1e30f};
    std::vector<float> numbers(std::begin(hard), std::end(hard));
    for (int k = 0; k < 255; ++k) // the float nearest to a boundary, and those beside it
        for (const float most : {255.f, 127.f}) {
            const float v = (float(k) + 0.5f) / most;
            numbers.insert(numbers.end(), {v, std::nextafter(v, 0.f), std::nextafter(v, 2.f), -v});
        }
    while (numbers.size() < count)
        numbers.push_back(unit(random));
    numbers.resize(count);
    return numbers;
}

// [cameras, pixels, width] as a format has it, by the rounding that picture.h says, in double
std::vector<uint8_t> texels_reference(const std::vector<float>& x, uint32_t cameras, uint32_t width, Texels texels)
{
    std::vector<uint8_t> bytes;
    const auto put = [&](uint32_t word, uint32_t count) {
        for (uint32_t i = 0; i < count; ++i)
            bytes.push_back(uint8_t(word >> 8 * i));
    };
    const auto whole = [](double v, double low, double most) {
        return uint32_t(int(std::round(most * std::clamp(v, low, 1.0)))) & 255;
    };
    const size_t numbers = x.size() / cameras;
    for (uint32_t camera = 0; camera < cameras; ++camera) {
        for (size_t i = 0; i < numbers; i += width) {
            const float* v = &x[camera * numbers + i];
            for (uint32_t c = 0; c < 4; ++c)
                switch (texels) {
                case Texels::unorm8:
                    put(whole(v[c], 0, 255), 1);
                    break;
                case Texels::snorm8:
                    put(c < 3 ? whole(v[c], -1, 127) : 0, 1);
                    break;
                case Texels::half4:
                    put(float_to_half(v[c]), 2);
                    break;
                case Texels::float4:
                    put(std::bit_cast<uint32_t>(v[c]), 4);
                    break;
                default:
                    break;
                }
            const auto bits = std::bit_cast<uint32_t>(v[0]);
            if (texels == Texels::half1)
                put(float_to_half(v[0]), 2);
            else if (texels == Texels::byte)
                put(std::min(bits, 255u), 1);
            else if (texels == Texels::float1 || texels == Texels::word)
                put(bits, 4);
        }
        bytes.resize(round_up(uint32_t(bytes.size()), 4)); // zeros fill a camera's last word
    }
    return bytes;
}

TEST(kernel_picture, numbers_become_texels_of_every_format)
{
    struct Case {
        Texels texels;
        uint32_t width;
    };
    for (const auto& [texels, width] : {Case{Texels::unorm8, 4},
                                        {Texels::snorm8, 4},
                                        {Texels::half4, 4},
                                        {Texels::float4, 4},
                                        {Texels::half1, 2},
                                        {Texels::float1, 2},
                                        {Texels::byte, 2},
                                        {Texels::word, 2}})
        for (const uint32_t pixels : {1u, 2u, 3u, 4u, 64u, 51u * 37})
            for (const uint32_t cameras : {1u, 3u}) {
                KernelCase k(test_device());
                std::vector<float> x = texel_numbers(size_t(cameras) * pixels * width, pixels);
                for (size_t i = 0; texels == Texels::byte && i < x.size(); i += 3)
                    x[i] = std::bit_cast<float>(uint32_t(i % 300)); // labels, too
                const Tensor y = splat_texels(k.graph, k.input(x, width), cameras, {texels});
                const Tensor out = k.output(y.rows, 1, DType::u32, 1);
                k.graph.keep(y, out);
                ASSERT_TRUE(k.compile_and_run());
                EXPECT_EQ(k.read_array<uint8_t>(out), texels_reference(x, cameras, width, texels))
                    << int(texels) << ": " << pixels << " of " << cameras;
            }
}

TEST(kernel_picture, colours_become_light)
{
    KernelCase k(test_device());
    std::vector<float> x = texel_numbers(4 * 1000, 1);
    for (size_t i = 0; i < x.size(); ++i) // colours of 0..1.02 and alpha, 0, too
        x[i] = i % 4 == 3 ? (i % 32 == 3 ? 0 : std::min(std::abs(x[i]), 1.f)) : float(i % 1021) / 1000;
    for (size_t i = 0; i < x.size(); ++i)
        x[i] *= i % 4 == 3 ? 1 : x[i / 4 * 4 + 3];
    const Tensor out = k.output(uint32_t(x.size()), 1, DType::u32, 1);
    k.graph.keep(splat_texels(k.graph, k.input(x, 4), 1, {.texels = Texels::float4, .linear = true}), out);
    ASSERT_TRUE(k.compile_and_run());
    const std::vector<float> got = k.read_array<float>(out);
    for (size_t i = 0; i < x.size(); ++i) {
        const double alpha = x[i / 4 * 4 + 3], v = alpha > 0 ? x[i] / alpha : 0;
        const double light = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
        const double expected = i % 4 == 3 ? alpha : alpha * light;
        ASSERT_NEAR(got[i], expected, 1e-6 * expected + 1e-38) << i; // some ten roundings
    }
}

TEST(kernel_picture, depths_become_numbers_of_a_z_buffer)
{
    for (const auto& [scale, offset] : {std::pair{-1.01f, 1.01f}, {0.2f, 0.f}, {-0.3f, 0.9f}}) {
        KernelCase k(test_device());
        std::vector<float> x = texel_numbers(2 * 1000, 7);
        for (size_t i = 0; i < x.size(); ++i)
            x[i] = i % 10 == 0 ? 0 : std::clamp(std::abs(x[i]) * 40, 0.2f, 1e6f); // metres
        const Tensor numbers = k.input(std::vector<float>{scale, offset}, 2), out = k.output(1000, 1, DType::u32, 1);
        k.graph.keep(splat_texels(k.graph, k.input(x, 2), 1, {.texels = Texels::float1, .scaled = true}, numbers), out);
        ASSERT_TRUE(k.compile_and_run());
        const std::vector<float> got = k.read_array<float>(out);
        for (size_t i = 0; i < got.size(); ++i) {
            const double z = x[2 * i], d = double(offset) + (z > 0 ? scale / z : 0);
            ASSERT_NEAR(got[i], std::clamp(d, 0.0, 1.0), 1.3e-7) << z; // of a quotient below 2 and a sum below 1
        }
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
