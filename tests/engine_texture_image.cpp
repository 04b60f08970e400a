// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/texture_image.h"

#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace engine_texture_image_test {

Result<ImageRgb8> picture_of(const Path& path)
{
    TextureBudget budget;
    return read_texture(path, budget).map([](ImageWithAlpha image) { return std::move(image.color); });
}

using Bytes = std::vector<uint8_t>;

void put(Bytes& to, uint32_t value, size_t bytes)
{
    for (size_t i = 0; i < bytes; ++i)
        to.push_back(uint8_t(value >> (8 * i)));
}

std::string text_of(const Bytes& bytes)
{
    return {bytes.begin(), bytes.end()};
}

// 3 x 2 pixels in four colours, the top row first
const std::vector<std::array<uint8_t, 3>> kColors = {{255, 0, 0}, {0, 255, 0}, {1, 2, 3}, {250, 251, 252}};
const Bytes kIndices = {0, 1, 2, 3, 3, 3};

Bytes rgb()
{
    Bytes out;
    for (const uint8_t i : kIndices)
        out.insert(out.end(), kColors[i].begin(), kColors[i].end());
    return out;
}

void put_bgr(Bytes& to, uint8_t index)
{
    to.insert(to.end(), {kColors[index][2], kColors[index][1], kColors[index][0]});
}

// bits: 8, with a palette, or 24; a negative height says that the top row comes first
std::string bmp(uint32_t bits, int32_t height = 2, uint32_t colors = 4, int32_t width = 3)
{
    const uint32_t palette = bits == 8 ? 4 * colors : 0;
    Bytes out = {'B', 'M'};
    put(out, 54 + palette + 24, 4);
    put(out, 0, 4);
    put(out, 54 + palette, 4);
    put(out, 40, 4);
    put(out, uint32_t(width), 4);
    put(out, uint32_t(height), 4);
    put(out, 1, 2);
    put(out, bits, 2);
    out.resize(54);
    for (uint32_t i = 0; i < palette / 4; ++i) {
        put_bgr(out, uint8_t(i));
        out.push_back(0);
    }
    for (size_t row = 0; row < 2; ++row) {
        for (size_t x = 0; x < 3; ++x) {
            const uint8_t index = kIndices[3 * (height < 0 ? row : 1 - row) + x];
            if (bits == 8)
                out.push_back(index);
            else
                put_bgr(out, index);
        }
        out.resize((out.size() - 54 - palette + 3) / 4 * 4 + 54 + palette);
    }
    return text_of(out);
}

// type: 1 palette, 2 colours, 9 and 10 the same in runs. flags: 0x20 where the top row comes first
std::string tga(uint8_t type, uint8_t flags = 0x20, uint16_t width = 3, uint16_t height = 2)
{
    const bool palette = type % 8 == 1;
    Bytes out = {3, palette, type};
    put(out, 0, 2);
    put(out, palette ? 4 : 0, 2);
    out.push_back(palette ? 24 : 0);
    put(out, 0, 4);
    put(out, width, 2);
    put(out, height, 2);
    out.insert(out.end(), {uint8_t(palette ? 8 : 24), flags, 'i', 'd', '!'});
    for (uint8_t i = 0; palette && i < 4; ++i)
        put_bgr(out, i);
    const auto pixel = [&](size_t at) {
        if (palette)
            out.push_back(kIndices[at]);
        else
            put_bgr(out, kIndices[at]);
    };
    if (type > 8) { // three pixels as they are, then one three times
        out.push_back(2);
        for (size_t i = 0; i < 3; ++i)
            pixel(i);
        out.push_back(0x82);
        pixel(3);
    } else {
        for (size_t i = 0; i < 6; ++i)
            pixel(flags & 0x20 ? i : (i + 3) % 6);
    }
    return text_of(out);
}

// pixels of RGBE, in rows
std::string hdr(uint32_t width, uint32_t height, const Bytes& data)
{
    return fmt::format("#?RADIANCE\nSOFTWARE=test\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", height, width) +
           text_of(data);
}

// two rows of nine pixels: runs of red and of exponents, green and blue as they are
std::string hdr_in_runs()
{
    Bytes out;
    for (uint8_t row = 0; row < 2; ++row) {
        out.insert(out.end(), {2, 2, 0, 9, 128 + 9, 128});
        for (uint8_t channel = 1; channel < 3; ++channel) {
            out.push_back(9);
            for (uint8_t x = 0; x < 9; ++x)
                out.push_back(uint8_t(16 * x + row));
        }
        out.insert(out.end(), {128 + 4, 128, 128 + 5, 128});
    }
    return hdr(9, 2, out);
}

struct NamedFile {
    const char* name;
    std::string bytes;
};
std::vector<NamedFile> files()
{
    return {{"24.bmp", bmp(24)},
            {"down.bmp", bmp(24, -2)},
            {"palette.bmp", bmp(8)},
            {"raw.tga", tga(2)},
            {"up.tga", tga(2, 0)},
            {"runs.tga", tga(10)},
            {"palette.TGA", tga(1)},
            {"palette_runs.tga", tga(9)},
            {"flat.hdr", hdr(2, 1, {128, 128, 128, 128, 128, 64, 0, 129})},
            {"runs.hdr", hdr_in_runs()}};
}

TEST(TextureImage, bmp_and_tga_files_give_their_pixels)
{
    const ScratchFolder folder;
    for (const NamedFile& f : files())
        if (!f.bytes.starts_with("#?")) {
            const auto image = picture_of(folder.put(f.name, f.bytes));
            ASSERT_TRUE(image) << image.error().message;
            EXPECT_EQ(image->width, 3u) << f.name;
            EXPECT_EQ(image->height, 2u) << f.name;
            EXPECT_EQ(image->pixels, rgb()) << f.name;
        }
}

TEST(TextureImage, light_of_an_hdr_is_clamped_and_becomes_srgb)
{
    const ScratchFolder folder;
    // mantissa / 256 * 2^(exponent - 128): 0.5 0.5 0.5, then 1 0.5 0, then 4 0.25 0, then black
    const auto flat =
        picture_of(folder.put("a.hdr", hdr(4, 1, {128, 128, 128, 128, 128, 64, 0, 129, 128, 8, 0, 131, 9, 9, 9, 0})));
    ASSERT_TRUE(flat) << flat.error().message;
    EXPECT_EQ(flat->pixels, (Bytes{188, 188, 188, 255, 188, 0, 255, 137, 0, 0, 0, 0}));
    const auto runs = picture_of(folder.put("b.hdr", hdr_in_runs()));
    ASSERT_TRUE(runs) << runs.error().message;
    ASSERT_EQ(runs->pixels.size(), 54u);
    EXPECT_EQ(runs->pixels[24], 188);    // 0.5
    EXPECT_EQ(runs->pixels[25], 188);    // 128 / 256
    EXPECT_EQ(runs->pixels[27 + 1], 13); // 1 / 256
    EXPECT_EQ(runs->pixels[3 + 2], 71);  // 16 / 256
}

TEST(TextureImage, what_a_file_is_is_told_by_its_first_bytes_and_only_a_tga_by_its_name)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_rgb8(folder / "a.tga", 3, 2, rgb()));
    EXPECT_EQ(picture_of(folder / "a.tga")->pixels, rgb());
    EXPECT_EQ(picture_of(folder.put("b.png", bmp(24)))->pixels, rgb());
    EXPECT_EQ(picture_of(folder.put("c.tga", hdr_in_runs()))->width, 9u);
    EXPECT_TRUE(says(picture_of(folder.put("d.bmp", tga(2))),
                     "expected a PNG, JPEG, BMP, HDR or TGA image, found something else"));
    EXPECT_TRUE(says(picture_of(folder.put("e.tga", "no picture")), "e.tga': not a valid TGA"));
    EXPECT_TRUE(says(picture_of(folder.put("f.tga", "")), "not a valid TGA"));
    EXPECT_TRUE(says(picture_of(folder / "none.bmp"), "none.bmp"));
}

TEST(TextureImage, alpha_of_a_tga_is_kept)
{
    const ScratchFolder folder;
    // 2 x 1 pixels of 32 bits, blue first: (3, 2, 1) at 0, (30, 20, 10) at 255
    Bytes file = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 32, 0x28, 1, 2, 3, 0, 10, 20, 30, 255};
    TextureBudget budget;
    const auto image = read_texture(folder.put("a.tga", text_of(file)), budget);
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->color.pixels, (Bytes{3, 2, 1, 30, 20, 10}));
    EXPECT_EQ(image->alpha, (Bytes{0, 255}));
    file[21] = 255;
    EXPECT_TRUE(read_texture(folder.put("a.tga", text_of(file)), budget)->alpha.empty());
}

TEST(TextureImage, a_file_cut_anywhere_is_refused)
{
    const ScratchFolder folder;
    for (const NamedFile& f : files())
        for (size_t length = 0; length < f.bytes.size(); ++length) {
            const auto image = picture_of(folder.put(f.name, f.bytes.substr(0, length)));
            ASSERT_FALSE(image) << f.name << " of " << length;
            EXPECT_EQ(image.error().code, ErrorCode::bad_input);
        }
}

TEST(TextureImage, changed_bytes_give_an_error_or_always_the_same_picture)
{
    const ScratchFolder folder;
    std::mt19937 random(7);
    size_t read = 0;
    for (const NamedFile& f : files())
        for (int i = 0; i < 250; ++i) {
            std::string changed = f.bytes;
            for (uint32_t n = random() % 3 + 1; n > 0; --n)
                changed[random() % changed.size()] = char(random());
            const Path path = folder.put(f.name, changed);
            const auto image = picture_of(path), again = picture_of(path);
            ASSERT_EQ(bool(image), bool(again));
            if (!image)
                continue;
            ++read;
            ASSERT_EQ(image->pixels.size(), size_t(3) * image->width * image->height);
            ASSERT_EQ(image->pixels, again->pixels) << f.name;
        }
    EXPECT_GT(read, 500u); // else nothing but headers was tested
}

TEST(TextureImage, a_small_file_that_claims_a_huge_image_is_refused_before_it_is_allocated)
{
    const ScratchFolder folder;
    for (const auto& [name, bytes, error] : std::initializer_list<std::array<std::string, 3>>{
             {"a.bmp", bmp(24, 16384, 4, 16384), "16384 x 16384 pixels cannot come from 78 bytes; the file is cut"},
             {"a.bmp", bmp(24, 16385), "an image of 3 x 16385 pixels, expected 1 to 16384"},
             {"a.bmp", bmp(24, INT32_MIN), "an image of 3 x 2147483648 pixels"},
             {"a.bmp", bmp(24, 2, 4, -3), "an image of -3 x 2 pixels"},
             {"a.tga", tga(10, 0, 16000, 16000), "16000 x 16000 pixels cannot come from"},
             {"a.tga", tga(2, 0, 65535, 2), "an image of 65535 x 2 pixels"},
             {"a.hdr", hdr(10000, 10000, {}), "10000 x 10000 pixels cannot come from"},
             {"a.hdr", hdr(0, 10, {}), "an image of 0 x 10 pixels"},
             {"a.hdr", hdr(4294967295u, 1, {}), "expected 1 to 16384"}})
        EXPECT_TRUE(says(picture_of(folder.put(name, bytes)), error)) << name;
}

TEST(TextureImage, an_hdr_that_ends_within_a_run_ends_in_an_error)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(picture_of(folder.put("a.hdr", hdr(9, 2, {2, 2, 0, 9, 128 + 4, 1}))), "the file is cut"));
    EXPECT_TRUE(says(picture_of(folder.put("a.hdr", hdr(9, 2, {2, 2, 0, 9, 0, 0, 0, 0}))), "the file is cut"));
    EXPECT_TRUE(says(picture_of(folder.put("a.hdr", hdr(9, 1, {2, 2, 0, 9, 128 + 10, 1}))),
                     "not a valid HDR: bad RLE data in HDR"));
}

TEST(TextureImage, what_would_be_read_wrong_is_refused)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(picture_of(folder.put("a.bmp", bmp(8, 2, 3))), "a pixel has colour 3 of a palette of 3"));
    EXPECT_TRUE(says(picture_of(folder.put("a.bmp", bmp(2))), "2 bits a pixel"));
    EXPECT_TRUE(says(picture_of(folder.put("a.tga", tga(2, 0x30))), "rows from right to left"));
    std::string moved = tga(1);
    moved[3] = 2;
    EXPECT_TRUE(says(picture_of(folder.put("a.tga", moved)), "a TGA whose palette begins at 2"));
    std::string runs = bmp(8);
    runs[30] = 1;
    EXPECT_TRUE(says(picture_of(folder.put("a.bmp", runs)), "not a valid BMP: BMP type not supported: RLE"));
}

} // namespace engine_texture_image_test
} // namespace semrover
