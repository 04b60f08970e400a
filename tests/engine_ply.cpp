// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/format/ply.h"

#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <map>
#include <random>
#include <sstream>

namespace semrover {
namespace engine_ply_test {

struct PlyFile {
    std::vector<std::string> comments;
    std::vector<std::string> names;
    size_t count = 0;
    std::map<std::string, std::vector<double>> columns;
};

// a reader of its own, by property name, of float and uchar vertices
PlyFile read_ply(const std::filesystem::path& path)
{
    const std::string bytes = contents(path);
    const size_t end = bytes.find("end_header\n");
    EXPECT_NE(end, std::string::npos);
    std::istringstream lines(bytes.substr(0, end));
    std::string line;
    PlyFile file;
    std::vector<bool> is_float;
    std::getline(lines, line);
    EXPECT_EQ(line, "ply");
    std::getline(lines, line);
    EXPECT_EQ(line, "format binary_little_endian 1.0");
    while (std::getline(lines, line)) {
        std::istringstream words(line);
        std::string word, type, name;
        words >> word;
        if (word == "comment") {
            file.comments.push_back(line.substr(8));
        } else if (word == "element") {
            words >> name >> file.count;
            EXPECT_EQ(name, "vertex");
        } else if (word == "property") {
            words >> type >> name;
            file.names.push_back(name);
            is_float.push_back(type == "float");
        }
    }
    size_t at = end + 11;
    for (size_t i = 0; i < file.count; ++i)
        for (size_t p = 0; p < file.names.size(); ++p) {
            float value = 0;
            if (is_float[p])
                std::memcpy(&value, bytes.data() + at, 4);
            else
                value = static_cast<uint8_t>(bytes[at]);
            at += is_float[p] ? 4 : 1;
            file.columns[file.names[p]].push_back(value);
        }
    EXPECT_EQ(at, bytes.size());
    return file;
}

Splats two_splats()
{
    return {{{1, 2, 3}, {-4, 5.5f, 1e-3f}},
            {{0, 0, 1}, {-1, 0, 0}},
            {{0, 0.5f, 1}, {0.2f, 0.4f, 0.6f}},
            {0.1f, 0.2f},
            {0.05f, 0.3f},
            {0.5f, 1.0f},
            {3, 19}};
}

TEST(Ply, points_carry_colour_and_label)
{
    const ScratchFolder folder;
    Splats s = two_splats();
    s.normal.clear();
    s.opacity.clear();
    ASSERT_TRUE(write_points_ply(folder / "p.ply", s));
    PlyFile file = read_ply(folder / "p.ply");
    EXPECT_EQ(file.names, (std::vector<std::string>{"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "label"}));
    EXPECT_EQ(file.columns["y"], (std::vector<double>{2, 5.5}));
    EXPECT_EQ(file.columns["red"], (std::vector<double>{0, 51}));
    EXPECT_EQ(file.columns["green"], (std::vector<double>{128, 102}));
    EXPECT_EQ(file.columns["blue"], (std::vector<double>{255, 153}));
    EXPECT_EQ(file.columns["label"], (std::vector<double>{3, 19}));
}

TEST(Ply, the_3dgs_file_has_a_thin_third_scale_after_the_second)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_splats_ply(folder / "s.ply", two_splats(), SplatPly::gaussian_3d));
    PlyFile file = read_ply(folder / "s.ply");
    EXPECT_EQ(file.names,
              (std::vector<std::string>{"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                                        "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}));
    EXPECT_TRUE(file.comments.empty());
    EXPECT_NEAR(file.columns["f_dc_0"][0], -0.5 / 0.28209479, 1e-6);
    EXPECT_EQ(file.columns["f_dc_1"][0], 0);
    EXPECT_NEAR(0.5 + 0.28209479 * file.columns["f_dc_2"][1], 0.6, 1e-6);
    EXPECT_EQ(file.columns["opacity"][0], 0);
    EXPECT_NEAR(file.columns["opacity"][1], std::log(1e6), 0.1); // 1 is clamped to 1 - 1e-6
    EXPECT_NEAR(std::exp(file.columns["scale_0"][1]), 0.2, 1e-6);
    EXPECT_NEAR(std::exp(file.columns["scale_1"][0]), 0.05, 1e-6);
    EXPECT_NEAR(file.columns["scale_2"][0], std::log(1e-4), 1e-5);
}

TEST(Ply, the_2dgs_file_has_two_scales_and_says_so)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_splats_ply(folder / "s.ply", two_splats(), SplatPly::gaussian_2d));
    PlyFile file = read_ply(folder / "s.ply");
    EXPECT_EQ(file.comments, std::vector<std::string>{"SplatRenderMode: 2dgs"});
    EXPECT_FALSE(file.columns.contains("scale_2"));
    EXPECT_EQ(file.names.size(), 16u);
    EXPECT_NEAR(std::exp(file.columns["scale_1"][1]), 0.3, 1e-6);
}

// the third axis of the rotation matrix of a quaternion w, x, y, z
std::array<double, 3> third_axis(const std::array<float, 4>& q)
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

std::array<double, 3> first_axis(const std::array<float, 4>& q)
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
}

TEST(Ply, the_rotation_takes_z_to_the_normal_and_x_to_the_tangent)
{
    std::mt19937 random(5);
    std::normal_distribution<float> normal;
    std::vector<std::array<float, 3>> normals = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (int i = 0; i < 200; ++i) {
        std::array<float, 3> n = {normal(random), normal(random), normal(random)};
        const float length = std::hypot(n[0], n[1], n[2]);
        for (float& c : n)
            c /= length;
        normals.push_back(n);
    }
    for (const auto& n : normals) {
        const auto [u, v] = tangents_of(n);
        const auto q = splat_rotation(n);
        EXPECT_GE(q[0], 0);
        for (size_t axis = 0; axis < 3; ++axis) {
            EXPECT_NEAR(third_axis(q)[axis], n[axis], 1e-6);
            EXPECT_NEAR(first_axis(q)[axis], u[axis], 1e-6);
            // right-handed: v = n x u
            EXPECT_NEAR(v[axis], n[(axis + 1) % 3] * u[(axis + 2) % 3] - n[(axis + 2) % 3] * u[(axis + 1) % 3], 1e-6);
        }
    }
    // n = z leans on x least: u = x cross z = -y
    EXPECT_FLOAT_EQ(tangents_of({0, 0, 1}).u[1], -1);
}

TEST(Ply, splats_that_cannot_be_written_are_named_and_leave_no_file)
{
    const ScratchFolder folder;
    const auto broken = [&](auto&& change) {
        Splats s = two_splats();
        change(s);
        return write_splats_ply(folder / "s.ply", s, SplatPly::gaussian_3d);
    };
    EXPECT_TRUE(says(write_points_ply(folder / "s.ply", {}), "there are no points"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.position[1][2] = NAN; }), "point 1 has a number that is not finite"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.color[0][0] = INFINITY; }), "point 0 has a number that is not finite"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.normal[1] = {0, 0, 0}; }), "splat 1 has the normal (0, 0, 0)"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.normal[0][0] = NAN; }), "splat 0 has the normal (nan, 0, 1)"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.sigma_v[1] = 0; }), "splat 1 has sigmas 0.2 and 0"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.sigma_u[1] = INFINITY; }), "splat 1 has sigmas inf"));
    EXPECT_TRUE(says(broken([](Splats& s) { s.opacity[0] = NAN; }), "opacity nan"));
    EXPECT_TRUE(says(write_points_ply(folder / "no" / "s.ply", two_splats()), "cannot write"));
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(PlyDeathTest, arrays_of_different_lengths_are_a_bug)
{
    Splats s = two_splats();
    s.label.pop_back();
    EXPECT_DEATH(static_cast<void>(write_points_ply("/tmp/never.ply", s)), "2 points with 2 colors and 1 labels");
}

} // namespace engine_ply_test
} // namespace semrover
