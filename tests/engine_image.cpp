// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/image.h"
#include "engine/format/npy.h"
#include "engine/format/number_image.h"
#include "runtime/base/dtype.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/png_file.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/dataset/depth_image.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <gtest/gtest.h>
#include <jpeglib.h>
#include <random>

namespace semrover {
namespace engine_image_test {

template <typename T>
std::vector<T> noise(size_t count)
{
    std::mt19937 random(3);
    std::vector<T> values(count);
    for (T& v : values)
        v = static_cast<T>(random());
    return values;
}

std::string bytes_of_hex(std::string_view hex)
{
    std::string bytes;
    for (size_t i = 0; i < hex.size(); i += 2)
        bytes += static_cast<char>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16));
    return bytes;
}

TEST(Image, colour_pixels_read_back_the_same)
{
    const ScratchFolder folder;
    for (const auto& [width, height] : std::vector<std::pair<uint32_t, uint32_t>>{{1, 1}, {7, 5}, {616, 424}}) {
        const auto pixels = noise<uint8_t>(size_t(3) * width * height);
        ASSERT_TRUE(write_png_rgb8(folder / "a.png", width, height, pixels));
        const auto image = read_png_rgb8(folder / "a.png");
        ASSERT_TRUE(image) << image.error().message;
        EXPECT_EQ(image->width, width);
        EXPECT_EQ(image->height, height);
        EXPECT_EQ(image->pixels, pixels);
    }
}

TEST(Image, gray_reads_back_as_three_equal_channels)
{
    const ScratchFolder folder;
    const auto pixels = noise<uint8_t>(35);
    ASSERT_TRUE(write_png_gray8(folder / "a.png", 7, 5, pixels));
    const auto image = read_png_rgb8(folder / "a.png");
    ASSERT_TRUE(image) << image.error().message;
    for (size_t i = 0; i < pixels.size() * 3; ++i)
        EXPECT_EQ(image->pixels[i], pixels[i / 3]);
}

TEST(Image, sixteen_bits_keep_every_value_and_are_big_endian_in_the_file)
{
    const ScratchFolder folder;
    std::vector<uint16_t> pixels(65536);
    for (size_t i = 0; i < pixels.size(); ++i)
        pixels[i] = static_cast<uint16_t>(i);
    ASSERT_TRUE(write_png_gray16(folder / "a.png", 256, 256, pixels));
    const auto image = read_png_gray16(folder / "a.png");
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->pixels, pixels);
    // the same file as 8 bits: the value / 257; a swapped file would give the low one
    EXPECT_EQ(read_png_rgb8(folder / "a.png")->pixels[3 * 0xab34], 0xab);
    ASSERT_TRUE(write_png_gray8(folder / "b.png", 1, 1, std::vector<uint8_t>{1}));
    EXPECT_TRUE(says(read_png_gray16(folder / "b.png"), "expected a PNG of 16-bit gray"));
    EXPECT_TRUE(says(read_depth_picture(folder / "b.png", 0.001), "expected a PNG of 16-bit gray"));
}

TEST(Image, the_same_pixels_give_the_same_bytes)
{
    const ScratchFolder folder;
    const auto pixels = noise<uint8_t>(300);
    ASSERT_TRUE(write_png_rgb8(folder / "a.png", 10, 10, pixels));
    ASSERT_TRUE(write_png_rgb8(folder / "b.png", 10, 10, pixels));
    EXPECT_EQ(contents(folder / "a.png"), contents(folder / "b.png"));
}

TEST(Image, a_size_of_zero_or_beyond_the_limit_is_refused_and_nothing_is_written)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(write_png_rgb8(folder / "a.png", 0, 5, {}), "an image of 0 x 5 pixels"));
    EXPECT_TRUE(says(write_png_gray8(folder / "a.png", 5, 0, {}), "an image of 5 x 0 pixels"));
    EXPECT_TRUE(says(write_png_gray16(folder / "a.png", 16385, 1, {}), "expected 1 to 16384"));
    EXPECT_TRUE(says(write_png_gray8(folder / "no" / "a.png", 1, 1, std::vector<uint8_t>{1}), "cannot write"));
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(Image, what_is_no_png_is_refused)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(read_png_rgb8(folder.put("a", "")), "expected a PNG file"));
    EXPECT_TRUE(says(read_png_rgb8(folder.put("a", "\xff\xd8\xff\xe0JFIF....")), "expected a PNG file"));
    EXPECT_TRUE(says(read_png_rgb8(folder.put("a", "\x89PNG\r\n\x1a\n")), "the file is cut"));
    EXPECT_TRUE(says(read_png_rgb8(folder / "none"), "No such file"));
}

TEST(Image, a_png_cut_anywhere_or_with_changed_bytes_never_crashes)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_rgb8(folder / "a.png", 9, 4, noise<uint8_t>(108)));
    const std::string whole = contents(folder / "a.png");
    for (size_t length = 0; length + 1 < whole.size(); ++length)
        EXPECT_FALSE(read_png_rgb8(folder.put("b.png", whole.substr(0, length)))) << length;
    std::mt19937 random(7);
    for (int i = 0; i < 2000; ++i) {
        std::string changed = whole;
        changed[random() % changed.size()] = static_cast<char>(random());
        if (const auto image = read_png_rgb8(folder.put("b.png", changed))) {
            EXPECT_EQ(image->pixels.size(), size_t(3) * image->width * image->height);
        }
    }
}

TEST(Image, a_small_file_that_claims_a_huge_image_is_refused_before_it_is_allocated)
{
    const ScratchFolder folder;
    // 16384 x 16384 RGB, valid check sums, no data
    const std::string ihdr("\0\0\0\x0dIHDR\0\0\x40\0\0\0\x40\0\x08\x02\0\0\0\x26\xaa\x87\xd3", 25);
    const std::string idat("\0\0\0\0IDAT\x35\xaf\x06\x1e", 12);
    EXPECT_TRUE(says(read_png_rgb8(folder.put("a", "\x89PNG\r\n\x1a\n" + ihdr + idat)),
                     "16384 x 16384 pixels cannot come from 45 bytes"));
}

TEST(Image, a_palette_with_transparency_becomes_rgb)
{
    const ScratchFolder folder;
    // 4 x 2 pixels of 2 bits: colours 0 1 2 3, then 3 2 1 0; colour i is (3i, 3i + 1, 3i + 2); made with Python's zlib
    static constexpr std::string_view kHex =
        "89504e470d0a1a0a0000000d494844520000000400000002020300000002c695f00000000c504c5445000102030405060708090a0bdc4c"
        "389c"
        "0000000174524e5380ad5e5b460000000c49444154789c639066780200013901004564919b0000000049454e44ae426082";
    const auto image = read_png_rgb8(folder.put("a", bytes_of_hex(kHex)));
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->pixels,
              (std::vector<uint8_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 9, 10, 11, 6, 7, 8, 3, 4, 5, 0, 1, 2}));
    const std::string file = bytes_of_hex(kHex);
    const auto with_alpha = decode_image_with_alpha(std::as_bytes(std::span(file)), "a.png");
    ASSERT_TRUE(with_alpha) << with_alpha.error().message;
    EXPECT_EQ(with_alpha->color.pixels, image->pixels);
    EXPECT_EQ(with_alpha->alpha, (std::vector<uint8_t>{128, 255, 255, 255, 255, 255, 255, 128}));
}

// ---- JPEG

TEST(Image, jpeg_pixels_come_back_nearly_the_same_and_always_as_the_same_bytes)
{
    const ScratchFolder folder;
    std::vector<uint8_t> pixels;
    for (uint32_t y = 0; y < 53; ++y)
        for (uint32_t x = 0; x < 77; ++x)
            pixels.insert(pixels.end(), {uint8_t(3 * x), uint8_t(4 * y), uint8_t(x + y)});
    ASSERT_TRUE(write_jpeg_rgb8(folder / "a.jpg", 77, 53, pixels, 95));
    ASSERT_TRUE(write_jpeg_rgb8(folder / "b.jpg", 77, 53, pixels, 95));
    EXPECT_EQ(contents(folder / "a.jpg"), contents(folder / "b.jpg"));
    const auto image = read_jpeg_rgb8(folder / "a.jpg");
    ASSERT_TRUE(image) << image.error().message;
    ASSERT_EQ(image->pixels.size(), pixels.size());
    for (size_t i = 0; i < pixels.size(); ++i)
        ASSERT_NEAR(image->pixels[i], pixels[i], 8) << i; // chroma is halved: 5 at most here
    ASSERT_TRUE(write_jpeg_rgb8(folder / "c.jpg", 77, 53, pixels, 20));
    EXPECT_LT(std::filesystem::file_size(folder / "c.jpg"), std::filesystem::file_size(folder / "a.jpg"));
}

// 16 x 16 pixels of one colour in four inks, as they are stored
std::string four_inks(const std::array<uint8_t, 4>& stored, J_COLOR_SPACE space, bool adobe)
{
    jpeg_compress_struct info{};
    jpeg_error_mgr errors{};
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    unsigned char* bytes = nullptr;
    unsigned long size = 0;
    jpeg_mem_dest(&info, &bytes, &size);
    info.image_width = info.image_height = 16;
    info.input_components = 4;
    info.in_color_space = JCS_CMYK;
    jpeg_set_defaults(&info);
    jpeg_set_colorspace(&info, space);
    jpeg_set_quality(&info, 100, TRUE);
    info.write_Adobe_marker = adobe;
    jpeg_start_compress(&info, TRUE);
    std::vector<uint8_t> row;
    for (int x = 0; x < 16; ++x)
        row.insert(row.end(), stored.begin(), stored.end());
    uint8_t* rows = row.data();
    while (info.next_scanline < 16)
        jpeg_write_scanlines(&info, &rows, 1);
    jpeg_finish_compress(&info);
    std::string out(reinterpret_cast<char*>(bytes), size);
    jpeg_destroy_compress(&info);
    std::free(bytes);
    return out;
}

TEST(Image, a_jpeg_of_four_inks_is_read_whichever_way_it_stores_them)
{
    // 20 % cyan, 60 % magenta, 100 % yellow, 10 % black on white paper
    const std::array<uint8_t, 4> ink = {51, 153, 255, 26}, light = {204, 102, 0, 229};
    const std::array<double, 3> rgb = {255 * 0.8 * 0.898, 255 * 0.4 * 0.898, 0};
    const std::string ycck = four_inks(light, JCS_YCCK, true);
    for (const std::string& file : {four_inks(light, JCS_CMYK, true), ycck, four_inks(ink, JCS_CMYK, false)}) {
        const auto image = decode_jpeg_rgb8(std::as_bytes(std::span(file)), "a.jpg");
        ASSERT_TRUE(image) << image.error().message;
        ASSERT_EQ(image->pixels.size(), 16u * 16 * 3);
        for (size_t i = 0; i < image->pixels.size(); ++i)
            ASSERT_NEAR(image->pixels[i], rgb[i % 3], 2.5) << i;
    }
    const std::string cut = ycck.substr(0, ycck.size() - 20);
    EXPECT_TRUE(says(decode_jpeg_rgb8(std::as_bytes(std::span(cut)), "a.jpg"), "not a valid JPEG"));
}

TEST(Image, alpha_is_kept_where_it_is_asked_for_and_not_everywhere_opaque)
{
    // 2 x 1 pixels: (1, 2, 3, 0) and (4, 5, 6, 255); the same, both opaque; gray 9 with 0 and 7 with 128
    const std::string
        holes = bytes_of_hex(
            "89504e470d0a1a0a0000000d4948445200000002000000010806000000f4227f8a0000001149444154789c6360646266"
            "606165fb0f00015b0115ba7c712b0000000049454e44ae426082"),
        opaque = bytes_of_hex(
            "89504e470d0a1a0a0000000d4948445200000002000000010806000000f4227f8a0000001149444154789c63606462fe"
            "cfc2caf61f0006560214849bd08b0000000049454e44ae426082"),
        gray = bytes_of_hex(
            "89504e470d0a1a0a0000000d49484452000000020000000108040000005e2bb7010000000d49444154789c63e064606f"
            "000000b70091de82d49e0000000049454e44ae426082");
    const auto decoded = [](const std::string& file) {
        auto image = decode_image_with_alpha(std::as_bytes(std::span(file)), "a.png");
        EXPECT_TRUE(image) << image.error().message;
        return image ? std::move(*image) : ImageWithAlpha{};
    };
    EXPECT_EQ(decoded(holes).color.pixels, (std::vector<uint8_t>{1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(decoded(holes).alpha, (std::vector<uint8_t>{0, 255}));
    EXPECT_EQ(decoded(opaque).color.pixels, (std::vector<uint8_t>{1, 2, 3, 4, 5, 6}));
    EXPECT_TRUE(decoded(opaque).alpha.empty());
    EXPECT_EQ(decoded(gray).color.pixels, (std::vector<uint8_t>{9, 9, 9, 7, 7, 7}));
    EXPECT_EQ(decoded(gray).alpha, (std::vector<uint8_t>{0, 128}));
}

TEST(Image, what_is_not_a_jpeg_is_refused)
{
    const ScratchFolder folder;
    EXPECT_TRUE(says(read_jpeg_rgb8(folder / "none.jpg"), "none.jpg"));
    EXPECT_TRUE(says(read_jpeg_rgb8(folder.put("empty.jpg", "")), "empty"));
    EXPECT_TRUE(says(read_jpeg_rgb8(folder.put("text.jpg", "no picture at all")), "not a valid JPEG"));
    EXPECT_TRUE(says(write_jpeg_rgb8(folder / "a.jpg", 0, 0, {}, 90), "0 x 0"));
}

// 24 x 17, progressive, in 10 scans; by Pillow 9.4
constexpr std::string_view kProgressiveJpeg =
    "ffd8ffe000104a46494600010100000100010000ffdb0043000d090a0b0a080d0b0a0b0e0e0d0f13201513121213271c"
    "1e17202e2931302e292d2c333a4a3e333646372c2d405741464c4e525352323e5a615a50604a51524fffdb0043010e0e"
    "0e131113261515264f352d354f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f"
    "4f4f4f4f4f4f4f4f4f4f4f4f4f4fffc20011080011001803012200021101031101ffc400170001010101000000000000"
    "00000000000000040503ffc4001801000203000000000000000000000000000205030406ffda000c0301000210031000"
    "0001c5a2da42389ac365c692be7a906cbfffc400161001010100000000000000000000000000000103ffda0008010100"
    "01050299a6699a6699a66888ffc400191100020301000000000000000000000000000203042131ffda0008010301013f"
    "0186c0b630845e1fffc4001811000203000000000000000000000000000001021012ffda0008010201013f0153362aff"
    "c40014100100000000000000000000000000000030ffda0008010100063f021fffc40016100101010000000000000000"
    "0000000000610020ffda0008010100013f2128a28a28b1ff00ffda000c03010002000300000010773f00ffc400171100"
    "03010000000000000000000000000000105161ffda0008010301013f10d0b1afffc40016110101010000000000000000"
    "0000000000000110ffda0008010201013f101308ffc40017100101010100000000000000000000000000311041ffda00"
    "08010100013f1049122589239739ffd9";

// the size in the header of frame, which follows its marker
std::string resized(std::string jpeg, uint16_t width, uint16_t height)
{
    size_t at = 2;
    while (jpeg[at + 1] != '\xc0' && jpeg[at + 1] != '\xc2')
        at += 2 + size_t(uint8_t(jpeg[at + 2])) * 256 + uint8_t(jpeg[at + 3]);
    for (const auto& [place, value] : {std::pair(at + 5, height), std::pair(at + 7, width)}) {
        jpeg[place] = char(value >> 8);
        jpeg[place + 1] = char(value & 255);
    }
    return jpeg;
}

TEST(Image, a_cut_jpeg_is_refused_wherever_it_is_cut)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_jpeg_rgb8(folder / "a.jpg", 70, 50, noise<uint8_t>(70 * 50 * 3), 90));
    for (const std::string& whole : {contents(folder / "a.jpg"), bytes_of_hex(kProgressiveJpeg)}) {
        EXPECT_TRUE(read_jpeg_rgb8(folder.put("whole.jpg", whole)));
        for (size_t bytes = 0; bytes < whole.size(); ++bytes)
            ASSERT_FALSE(read_jpeg_rgb8(folder.put("cut.jpg", whole.substr(0, bytes)))) << bytes;
        // with the end marker set behind the cut, pixels are missing all the same
        EXPECT_TRUE(says(read_jpeg_rgb8(folder.put("ends.jpg", whole.substr(0, whole.size() * 3 / 4) + "\xff\xd9")),
                         "ends.jpg': not a valid JPEG"));
    }
    // after the first scan's header: no component has a value yet
    const std::string progressive = bytes_of_hex(kProgressiveJpeg);
    const size_t scan = progressive.find("\xff\xda");
    EXPECT_FALSE(read_jpeg_rgb8(folder.put("none.jpg", progressive.substr(0, scan) + "\xff\xd9")));
}

TEST(Image, a_jpeg_has_no_more_pixels_than_its_bytes_can_hold)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_jpeg_rgb8(folder / "a.jpg", 70, 50, noise<uint8_t>(70 * 50 * 3), 90));
    const std::string whole = contents(folder / "a.jpg");
    EXPECT_TRUE(says(read_jpeg_rgb8(folder.put("b.jpg", resized(whole, 16384, 16384))),
                     fmt::format("b.jpg': 16384 x 16384 pixels in {} bytes, at most 16384 to a side and 1024 to a byte",
                                 whole.size())));
    EXPECT_TRUE(says(read_jpeg_rgb8(folder.put("c.jpg", resized(whole, 1024, 1024))), "premature end"));
    // a scan that is there 200 times
    const std::string progressive = bytes_of_hex(kProgressiveJpeg);
    const size_t begin = progressive.find("\xff\xda"), end = progressive.find("\xff\xc4", begin);
    std::string scans = progressive.substr(0, begin);
    for (int i = 0; i < 200; ++i)
        scans += progressive.substr(begin, end - begin);
    scans += progressive.substr(end);
    EXPECT_TRUE(says(read_jpeg_rgb8(folder.put("d.jpg", scans)), "more than 100 scans"));
}

TEST(Image, the_size_of_a_png_is_read_without_its_pixels)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_gray8(folder / "a.png", 7, 5, noise<uint8_t>(35)));
    EXPECT_EQ(*read_image_size(folder / "a.png"), (ImageSize{7, 5}));
    EXPECT_TRUE(says(read_image_size(folder.put("b.png", "no picture")), "expected a PNG file"));
    EXPECT_TRUE(
        says(read_image_size(folder.put("c.png", contents(folder / "a.png").substr(0, 20))), "not a valid PNG"));
}

// ---- class numbers

using Numbers = std::vector<uint16_t>;

std::string npy(DType type, std::vector<uint64_t> shape, const void* data, size_t bytes)
{
    NpyArray array{type, std::move(shape), {}};
    array.data.resize(bytes);
    std::memcpy(array.data.data(), data, bytes);
    const std::vector<std::byte> file = encode_npy(array);
    return {reinterpret_cast<const char*>(file.data()), file.size()};
}

template <typename T>
std::string npy(DType type, std::vector<uint64_t> shape, const std::vector<T>& values)
{
    return npy(type, std::move(shape), values.data(), values.size() * sizeof(T));
}

TEST(Image, class_numbers_are_what_any_kind_of_picture_stores)
{
    const ScratchFolder folder;
    const std::string colors = "\x07\x08\x09"
                               "\xff\x01\x02"
                               "\x80\x80\x80"
                               "\x0d\x0d\x0d";
    struct Case {
        const char* name;
        std::string file;
        Numbers numbers;
    };
    const auto png = [](int bits, int kind, const std::string& rows, const std::string& palette = "") {
        return PngFile{2, 2, bits, kind, rows, palette}.bytes();
    };
    const Case cases[] = {
        {"gray 1", png(1, PngFile::kGray, "\x40\x80"), {0, 1, 1, 0}},
        {"gray 2", png(2, PngFile::kGray, "\x70\x80"), {1, 3, 2, 0}},
        {"gray 4", png(4, PngFile::kGray, "\x2d\xf1"), {2, 13, 15, 1}},
        {"gray 8", png(8, PngFile::kGray, std::string("\x02\x0d\xff\0", 4)), {2, 13, 255, 0}},
        {"gray 16", png(16, PngFile::kGray, std::string("\0\x02\0\x0d\x04\xb0\xff\xff", 8)), {2, 13, 1200, 65535}},
        {"palette 2", png(2, PngFile::kPalette, "\xd0\x10", colors), {3, 1, 0, 1}},
        {"palette 8", png(8, PngFile::kPalette, std::string("\0\x03\x02\x01", 4), colors), {0, 3, 2, 1}},
        {"gray and alpha",
         png(8, PngFile::kGrayAlpha, std::string("\x02\xff\x0d\x01\x05\0\0\xff", 8)),
         {2, 13, 65535, 0}},
        {"gray and alpha 16",
         png(16, PngFile::kGrayAlpha, std::string("\0\x02\xff\xff\x01\0\0\x01\0\x05\0\0\0\0\xff\xff", 16)),
         {2, 256, 65535, 0}},
        {"rgb", png(8, PngFile::kRgb, std::string("\x02\x02\x02\x0d\x0d\x0d\0\0\0\xff\xff\xff", 12)), {2, 13, 0, 255}},
        {"rgba",
         png(8, PngFile::kRgba, std::string("\x02\x02\x02\xff\x0d\x0d\x0d\x01\x05\x06\x07\0\0\0\0\xff", 16)),
         {2, 13, 65535, 0}},
        {"npy u1", npy(DType::u8, {2, 2}, std::vector<uint8_t>{2, 13, 255, 0}), {2, 13, 255, 0}},
        {"npy i4", npy(DType::i32, {2, 2, 1}, std::vector<int32_t>{2, 1200, -1, 0}), {2, 1200, 65535, 0}},
        {"npy i8", npy(DType::i64, {1, 2, 2}, std::vector<int64_t>{2, 65535, -1, 0}), {2, 65535, 65535, 0}},
    };
    for (const Case& c : cases) {
        const auto image = read_label_image(folder.put("a", c.file));
        ASSERT_TRUE(image) << c.name << ": " << image.error().message;
        EXPECT_EQ(image->size, (ImageSize{2, 2})) << c.name;
        EXPECT_EQ(image->numbers, c.numbers) << c.name;
    }
    std::string big_endian = npy(DType::i16, {2, 2}, std::string("\0\x02\0\x0d\x04\xb0\xff\xff", 8).data(), 8);
    big_endian.replace(big_endian.find("<i2"), 3, ">i2");
    EXPECT_EQ(read_label_image(folder.put("a", big_endian))->numbers, (Numbers{2, 13, 1200, 65535}));
}

TEST(Image, pictures_that_hold_no_class_numbers_are_refused_by_name)
{
    const ScratchFolder folder;
    const auto file = [&](const std::string& bytes) { return read_label_image(folder.put("a", bytes)); };
    const std::string road(std::string("\x80\x40\x80\x80\x40\x80", 6));
    EXPECT_TRUE(
        says(file(PngFile{2, 1, 8, PngFile::kRgb, road, ""}.bytes()),
             "a': a picture in colour, expected class numbers: a PNG of gray values or palette indices (1 to 16 "
             "bits), or a .npy; found the colour (128, 64, 128) at column 0, row 0"));
    EXPECT_TRUE(says(file(PngFile{1, 1, 8, PngFile::kRgba, std::string("\x0d\0\0\xff", 4), ""}.bytes()),
                     "(CARLA's tags are its red channel: save that as gray)"));
    EXPECT_TRUE(says(file(PngFile{1, 1, 16, PngFile::kRgb, road, ""}.bytes()), "a picture in colour"));
    ASSERT_TRUE(write_jpeg_rgb8(folder / "a.jpg", 8, 8, std::vector<uint8_t>(192, 13), 95));
    EXPECT_TRUE(says(read_label_image(folder / "a.jpg"), "a JPEG, whose compression changes numbers"));
    EXPECT_TRUE(says(file(npy(DType::f32, {1, 1}, std::vector<float>{2})), "an array of fractions"));
    EXPECT_TRUE(says(file(npy(DType::i32, {1, 2}, std::vector<int32_t>{0, 70000})),
                     "class number 70000 at column 1, row 0, expected 0 to 65534"));
    EXPECT_TRUE(
        says(file(npy(DType::u8, {2, 2, 3}, std::vector<uint8_t>(12))), "of shape (2, 2, 3), expected [height"));
    EXPECT_TRUE(says(file(npy(DType::u8, {4}, std::vector<uint8_t>(4))), "of shape (4)"));
    EXPECT_TRUE(says(file(npy(DType::u8, {1, 20000}, std::vector<uint8_t>(20000))), "20000 x 1 pixels"));
    const std::string whole = npy(DType::u8, {16, 16}, std::vector<uint8_t>(256));
    EXPECT_TRUE(says(file(whole.substr(0, whole.size() - 1)), "the file is cut"));
    EXPECT_TRUE(says(file("no picture"), "expected a PNG file"));
}

// ---- depth

TEST(Image, depth_is_in_metres_whatever_holds_it)
{
    const ScratchFolder folder;
    const auto metres = [&](const std::string& file, const DepthEncoding& e = {}) {
        const auto depth = read_depth_image(folder.put("a", file), e);
        EXPECT_TRUE(depth) << depth.error().message;
        return depth ? depth->metres : std::vector<float>();
    };
    const auto near = [](const std::vector<float>& a, const std::vector<float>& b) {
        ASSERT_EQ(a.size(), b.size());
        for (size_t i = 0; i < a.size(); ++i)
            EXPECT_NEAR(a[i], b[i], 1e-4) << i;
    };
    const std::string gray = PngFile{3, 1, 16, PngFile::kGray, std::string("\x17\x70\0\0\xff\xff", 6), ""}.bytes();
    near(metres(gray), {6, 0, 0}); // millimetres
    near(metres(gray, {{}, 0.0002}), {1.2f, 0, 0});
    const float nan = std::nanf("");
    near(metres(npy(DType::f32, {1, 5}, std::vector<float>{6.25f, 0, -1, nan, INFINITY})), {6.25f, 0, 0, 0, 0});
    near(metres(npy(DType::f64, {1, 1}, std::vector<double>{70.125})), {70.125f});
    near(metres(npy(DType::f64, {1, 1}, std::vector<double>{600}), {{}, 0.01}), {6}); // Unreal's centimetres
    near(metres(npy(DType::f16, {1, 1}, std::vector<uint16_t>{float_to_half(6.5f)})), {6.5f});
    near(metres(npy(DType::u16, {1, 3}, std::vector<uint16_t>{6000, 0, 65535})), {6, 0, 0});
    // 6 m of CARLA is 100663 = 55 + 256 * 137 + 65536
    const std::string carla =
        PngFile{2, 1, 8, PngFile::kRgba, std::string("\x37\x89\x01\xff\xff\xff\xff\xff", 8), ""}.bytes();
    near(metres(carla), {6, 0});
    near(metres(carla, {DepthKind::carla, {}}), {6, 0});
    EXPECT_EQ(read_depth_image(folder.put("a", carla))->kind, DepthKind::carla);
}

TEST(Image, depth_along_the_ray_becomes_depth_along_the_axis)
{
    const Intrinsics k{100, 50, 2, 1, 4, 2};
    DepthImage depth{{4, 2}, {}, DepthKind::ray};
    for (uint32_t y = 0; y < 2; ++y)
        for (uint32_t x = 0; x < 4; ++x)
            depth.metres.push_back(float(6 * std::hypot((x + 0.5 - 2) / 100, (y + 0.5 - 1) / 50, 1)));
    make_axial(depth, k);
    for (const float z : depth.metres)
        EXPECT_NEAR(z, 6, 1e-6);
}

TEST(Image, pictures_that_hold_no_depth_are_refused_by_name)
{
    const ScratchFolder folder;
    const auto depth = [&](const std::string& bytes, std::optional<DepthKind> kind = {}) {
        return read_depth_image(folder.put("a", bytes), {kind, {}});
    };
    EXPECT_TRUE(says(depth(PngFile{1, 1, 8, PngFile::kGray, "\x05", ""}.bytes()),
                     "a': expected a PNG of 16-bit gray, or a .npy, found gray of 8 bits"));
    EXPECT_TRUE(says(depth(PngFile{1, 1, 8, PngFile::kRgb, "\x05\x05\x05", ""}.bytes()), "made to be looked at"));
    EXPECT_TRUE(says(depth(PngFile{1, 1, 8, PngFile::kRgb, "\x05\x06\x07", ""}.bytes(), DepthKind::z),
                     "found colour of 8 bits"));
    EXPECT_TRUE(says(depth(PngFile{1, 1, 16, PngFile::kGray, "\x05\x06", ""}.bytes(), DepthKind::carla),
                     "expected CARLA's depth in 8-bit colours, found gray of 16 bits"));
    EXPECT_TRUE(says(depth(npy(DType::f32, {1, 1}, std::vector<float>{1}), DepthKind::carla), "found an array"));
}

TEST(engine_image, depth_has_the_unit_of_its_file_and_of_fractions_its_own)
{
    const ScratchFolder folder;
    const std::vector<uint16_t> whole = {0, 1, 65534, 65535};
    ASSERT_TRUE(write_png_gray16(folder / "a.png", 2, 2, whole));
    const auto gray = read_depth_picture(folder / "a.png", 0.01);
    ASSERT_TRUE(gray) << gray.error().message;
    EXPECT_EQ(gray->pixels, (std::vector<uint32_t>{0, 1, 65534, 0})); // 65535 is nothing
    EXPECT_EQ(gray->unit, 0.01);
    const auto put = [&](const char* name, DType type, std::span<const std::byte> bytes) {
        const auto file = encode_npy({type, {2, 2}, {bytes.begin(), bytes.end()}});
        return folder.put(name, {reinterpret_cast<const char*>(file.data()), file.size()});
    };
    const auto same = read_depth_picture(put("b.npy", DType::u16, std::as_bytes(std::span(whole))), 0.01);
    ASSERT_TRUE(same) << same.error().message;
    EXPECT_EQ(same->pixels, gray->pixels);
    EXPECT_EQ(same->unit, 0.01);
    const std::vector<float> metres = {0.5f, 700.25f, -1, std::numeric_limits<float>::infinity()};
    const auto fine = read_depth_picture(put("c.npy", DType::f32, std::as_bytes(std::span(metres))), 0.01);
    ASSERT_TRUE(fine) << fine.error().message;
    for (size_t i = 0; i < 4; ++i)
        EXPECT_EQ(fine->pixels[i] * fine->unit, i < 2 ? metres[i] : 0.);
}

} // namespace engine_image_test
} // namespace semrover
