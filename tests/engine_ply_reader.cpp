// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// files written by hand from Greg Turk's description of the format
#include "engine/format/ply.h"
#include "engine/format/ply_reader.h"

#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <bit>
#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_ply_reader_test {

// bytes of a number, most or least significant first
template <typename T>
std::string number(T value, bool big_endian)
{
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    if (big_endian)
        std::ranges::reverse(bytes);
    return bytes;
}

std::vector<double> all(const PlyValues& values)
{
    std::vector<double> numbers;
    for (size_t i = 0; i < values.size(); ++i)
        numbers.push_back(values[i]);
    return numbers;
}

std::vector<double> values(const PlyFile& file, std::string_view element, std::string_view property)
{
    const PlyElement* e = file.find(element);
    const PlyProperty* p = e ? e->find(property) : nullptr;
    if (!p)
        throw std::runtime_error("no such property");
    return all(p->values);
}

// the cube's file of the description, cut to two faces
constexpr std::string_view kAscii = "ply\n"
                                    "format ascii 1.0\n"
                                    "comment made by hand\n"
                                    "obj_info of no use\n"
                                    "element vertex 3\n"
                                    "property float x\n"
                                    "property float32 y\n"
                                    "property double z\n"
                                    "comment in the midst  of it\n"
                                    "property uchar red\n"
                                    "element face 2\n"
                                    "property list uchar int vertex_indices\n"
                                    "property int16 label\n"
                                    "end_header\n"
                                    "0 0.25 -1e-3 255\n"
                                    "  1 +2\t3 7  \n"
                                    "\n"
                                    "nan inf 1 128.0\n"
                                    "3 0 1 2 -4\n"
                                    "0 9";

TEST(PlyReader, reads_text_with_comments_lists_and_loose_spaces)
{
    const ScratchFolder folder;
    const Result<PlyFile> file = read_ply(folder.put("a.ply", kAscii));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(file->comments, (std::vector<std::string>{"made by hand", "in the midst  of it"}));
    ASSERT_EQ(file->elements.size(), 2u);
    EXPECT_EQ(file->find("vertex")->rows, 3u);
    EXPECT_EQ(file->find("edge"), nullptr);
    EXPECT_EQ(file->find("vertex")->find("label"), nullptr);
    EXPECT_EQ(values(*file, "vertex", "y")[0], 0.25);
    EXPECT_EQ(values(*file, "vertex", "z"), (std::vector<double>{-1e-3, 3, 1}));
    EXPECT_EQ(values(*file, "vertex", "red"), (std::vector<double>{255, 7, 128}));
    EXPECT_TRUE(std::isnan(values(*file, "vertex", "x")[2]));
    EXPECT_TRUE(std::isinf(values(*file, "vertex", "y")[2]));
    const PlyProperty& indices = *file->find("face")->find("vertex_indices");
    EXPECT_TRUE(indices.is_list);
    EXPECT_EQ(all(indices.values), (std::vector<double>{0, 1, 2}));
    EXPECT_EQ(indices.starts, (std::vector<uint32_t>{0, 3, 3}));
    EXPECT_EQ(values(*file, "face", "label"), (std::vector<double>{-4, 9}));
    EXPECT_TRUE(file->find("vertex")->find("x")->is_float);
    EXPECT_FALSE(file->find("vertex")->find("red")->is_float);
    EXPECT_FALSE(file->find("vertex")->find("red")->is_list);
}

TEST(PlyReader, reads_every_type_in_both_byte_orders)
{
    const ScratchFolder folder;
    for (const bool big : {false, true}) {
        std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                            "_endian 1.0\nelement all 2\nproperty char a\nproperty uint8 b\nproperty short c\n"
                            "property uint16 d\nproperty int e\nproperty uint32 f\nproperty float g\n"
                            "property float64 h\nend_header\n";
        for (const int sign : {1, -1})
            bytes += number<int8_t>(static_cast<int8_t>(100 * sign), big) + number<uint8_t>(200, big) +
                     number<int16_t>(static_cast<int16_t>(30000 * sign), big) + number<uint16_t>(60000, big) +
                     number<int32_t>(2000000000 * sign, big) + number<uint32_t>(4000000000u, big) +
                     number<float>(0.1f * float(sign), big) + number<double>(0.1 * sign, big);
        const Result<PlyFile> file = read_ply(folder.put("b.ply", bytes));
        ASSERT_TRUE(file) << file.error().message;
        const double expected[] = {100, 200, 30000, 60000, 2e9, 4e9, double(0.1f), 0.1};
        for (size_t i = 0; i < 8; ++i) {
            const PlyProperty& p = file->elements[0].properties[i];
            EXPECT_EQ(p.values[0], expected[i]) << p.name;
            const bool has_sign = p.name != "b" && p.name != "d" && p.name != "f";
            EXPECT_EQ(p.values[1], has_sign ? -expected[i] : expected[i]) << p.name;
            EXPECT_EQ(p.is_float, i >= 6);
        }
    }
}

TEST(PlyReader, reads_binary_lists_between_scalars_and_elements_in_any_order)
{
    const ScratchFolder folder;
    for (const bool big : {false, true}) {
        // the first row begins with a byte that looks like a line's end
        const std::string bytes = std::string("ply\r\nformat binary_") + (big ? "big" : "little") +
                                  "_endian 1.0\r\nelement face 2\r\nproperty uchar label\r\n"
                                  "property list ushort uint i\r\nproperty list uchar float uv\r\n"
                                  "element vertex 1\r\nproperty uchar v\r\nend_header\r\n" +
                                  "\n" + number<uint16_t>(2, big) + number<uint32_t>(70000, big) +
                                  number<uint32_t>(1, big) + std::string("\0", 1) + //
                                  "\r" + number<uint16_t>(0, big) + "\1" + number<float>(0.5f, big) + "\7";
        const Result<PlyFile> file = read_ply(folder.put("l.ply", bytes));
        ASSERT_TRUE(file) << file.error().message;
        EXPECT_EQ(values(*file, "face", "label"), (std::vector<double>{10, 13}));
        EXPECT_EQ(values(*file, "face", "i"), (std::vector<double>{70000, 1}));
        EXPECT_EQ(file->find("face")->find("i")->starts, (std::vector<uint32_t>{0, 2, 2}));
        EXPECT_EQ(values(*file, "face", "uv"), (std::vector<double>{0.5}));
        EXPECT_EQ(file->find("face")->find("uv")->starts, (std::vector<uint32_t>{0, 0, 1}));
        EXPECT_EQ(values(*file, "vertex", "v"), (std::vector<double>{7}));
    }
}

TEST(PlyReader, reads_what_this_program_writes)
{
    const ScratchFolder folder;
    const Splats s = {{{1, 2, 3}, {-4, 5.5f, 1e-3f}},
                      {{0, 0, 1}, {-1, 0, 0}},
                      {{0, 0.5f, 1}, {0.2f, 0.4f, 0.6f}},
                      {0.1f, 0.2f},
                      {0.05f, 0.3f},
                      {0.5f, 1.0f},
                      {3, 19}};
    ASSERT_TRUE(write_points_ply(folder / "p.ply", s));
    const Result<PlyFile> points = read_ply(folder / "p.ply");
    ASSERT_TRUE(points) << points.error().message;
    EXPECT_EQ(values(*points, "vertex", "y"), (std::vector<double>{2, 5.5}));
    EXPECT_EQ(values(*points, "vertex", "green"), (std::vector<double>{128, 102}));
    EXPECT_EQ(values(*points, "vertex", "label"), (std::vector<double>{3, 19}));
    ASSERT_TRUE(write_splats_ply(folder / "s.ply", s, SplatPly::gaussian_2d));
    const Result<PlyFile> splats = read_ply(folder / "s.ply");
    ASSERT_TRUE(splats) << splats.error().message;
    EXPECT_EQ(splats->comments, std::vector<std::string>{"SplatRenderMode: 2dgs"});
    EXPECT_EQ(values(*splats, "vertex", "scale_1")[1], double(std::log(0.3f)));
}

TEST(PlyReader, refuses_malformed_files_and_says_where)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& text) { return read_ply(folder.put("m.ply", text)); };
    const std::string head = "ply\nformat ascii 1.0\nelement v 2\nproperty float x\nproperty uchar r\nend_header\n";
    const std::string binary = "ply\nformat binary_little_endian 1.0\n";
    EXPECT_TRUE(says(read_ply(folder / "none.ply"), "none.ply"));
    EXPECT_TRUE(says(read(""), "line 1: expected 'ply', found ''"));
    EXPECT_TRUE(says(read("plyx\n"), "line 1: expected 'ply', found 'plyx"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\nelement v 1\n"), "line 4: the file ends within the header"));
    EXPECT_TRUE(says(read("ply\nformat ascii 2.0\n"), "line 2: expected 'format KIND 1.0'"));
    EXPECT_TRUE(says(read("ply\nformat zip 1.0\n"), "line 2: expected the format ascii"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\nformat ascii 1.0\n"), "line 3: a second format"));
    EXPECT_TRUE(says(read("ply\nend_header\n"), "line 2: the header has no format"));
    EXPECT_TRUE(says(read("ply\nelement v -1\n"), "element 'v': expected a number of rows, found '-1'"));
    EXPECT_TRUE(says(read("ply\nelement v 99999999999999999999\n"), "found '99999999999999999999'"));
    EXPECT_TRUE(says(read("ply\nelement v\n"), "line 2: expected 'element NAME ROWS', found 2 words"));
    EXPECT_TRUE(says(read("ply\nelement v 1\nproperty float x\nelement v 1\n"), "line 4: a second element 'v'"));
    EXPECT_TRUE(says(read("ply\nelement v 1\nelement w 1\n"), "element 'v' has 1 rows but no properties"));
    EXPECT_TRUE(says(read("ply\nproperty float x\n"), "line 2: a property before the first element"));
    EXPECT_TRUE(says(read("ply\nelement v 1\nproperty half x\n"), "line 3: unknown type 'half'"));
    EXPECT_TRUE(says(read("ply\nelement v 1\nproperty list float int x\n"), "a list's length of type 'float'"));
    EXPECT_TRUE(says(read("ply\nelement v 1\nproperty list int x\n"), "line 3: expected 'property TYPE NAME'"));
    EXPECT_TRUE(says(read("ply\nelement v 1\nproperty int x\nproperty int x\n"), "has a second property 'x'"));
    EXPECT_TRUE(says(read("ply\nelemnt v 1\n"), "line 2: unknown keyword 'elemnt'"));
    EXPECT_TRUE(says(read("ply\n" + std::string(2u << 20, 'a')), "line 2: the header exceeds 1048576 bytes"));
    EXPECT_TRUE(says(read(head + "1 2\n3\n"), "line 8: the row ends before 'r'"));
    EXPECT_TRUE(says(read(head + "1 2\n    \n"), "line 8: the file ends at row 1 of 2 of element 'v'"));
    EXPECT_TRUE(says(read(head + "1 2\n3 4 5\n"), "line 8: more values than properties: '5'"));
    EXPECT_TRUE(says(read(head + "1 2\n3 256\n"), "line 8: 'r': expected a number of type uchar, found '256'"));
    EXPECT_TRUE(says(read(head + "1 2.5\n3 4\n"), "'r': expected a number of type uchar, found '2.5'"));
    EXPECT_TRUE(says(read(head + "1x 2\n3 4\n"), "line 7: 'x': expected a number of type float, found '1x'"));
    EXPECT_TRUE(says(read(head + "1e99 2\n3 4\n"), "'x': expected a number of type float, found '1e99'"));
    EXPECT_TRUE(says(read(head + "1 2\n3 4\n5 6\n"), "4 bytes follow the last element"));
    EXPECT_TRUE(says(read(binary + "element v 2\nproperty int x\nend_header\n1234567"),
                     "element 'v' has 2 rows of at least 4 bytes, but 7 bytes are left"));
    EXPECT_TRUE(
        says(read(binary + "element v 9\nproperty list uchar int x\nend_header\n1234"), "9 rows of at least 1"));
    EXPECT_TRUE(says(read(binary + "element v 1\nproperty list uchar int x\nend_header\n\2" + "1234567"),
                     "row 0 of element 'v': 'x': a list of 2 values, 7 bytes are left"));
    EXPECT_TRUE(says(read(binary + "element v 1\nproperty list char int x\nend_header\n\xff"), "a list of -1 values"));
    EXPECT_TRUE(says(read(binary + "element v 1\nproperty list uchar char x\nproperty int y\nend_header\n" +
                          std::string("\1a234", 5)),
                     "row 0 of element 'v': the file ends before 'y'"));
    EXPECT_TRUE(says(read(binary + "element v 1\nproperty char x\nend_header\nab"), "1 bytes follow"));
}

TEST(PlyReader, absurd_sizes_are_refused_before_anything_is_allocated)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& text) { return read_ply(folder.put("m.ply", text)); };
    const std::string rows = "element v 18446744073709551615\nproperty double x\nproperty double y\nend_header\n";
    EXPECT_TRUE(says(read("ply\nformat binary_big_endian 1.0\n" + rows), "18446744073709551615 rows"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\n" + rows + "1 2\n"), "18446744073709551615 rows"));
    const std::string list = "element v 1\nproperty list uint double x\nend_header\n";
    EXPECT_TRUE(
        says(read("ply\nformat binary_little_endian 1.0\n" + list + "\xff\xff\xff\xff"), "a list of 4294967295"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\n" + list + "4294967295 1\n"), "line 6: 'x': a list of 4294967295"));
    // no rows need no bytes
    EXPECT_TRUE(read("ply\nformat ascii 1.0\nelement v 0\nproperty float x\nelement w 0\nend_header\n"));
}

TEST(PlyReader, no_prefix_of_a_file_reads_or_crashes)
{
    const ScratchFolder folder;
    const std::string binary = "ply\nformat binary_big_endian 1.0\nelement a 2\nproperty int x\nelement b 1\n"
                               "property list uchar short i\nend_header\n" +
                               std::string("\0\0\0\1\0\0\0\2\2\0\3\0\4", 13);
    ASSERT_TRUE(read_ply(folder.put("t.ply", binary)));
    for (size_t n = 0; n < binary.size(); ++n)
        EXPECT_FALSE(read_ply(folder.put("t.ply", binary.substr(0, n)))) << n;
    // without a line's end the last number of a text may be cut short and still be one
    for (size_t n = 0; n + 1 < kAscii.size(); ++n)
        EXPECT_FALSE(read_ply(folder.put("t.ply", kAscii.substr(0, n)))) << n;
}

} // namespace engine_ply_reader_test
} // namespace semrover
