// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// splats of .ply, .glb and .splat files: written by hand from the formats' descriptions, and by this program
#include "engine/camera/rigid.h"
#include "engine/format/ply_reader.h"
#include "engine/format/splat_file.h"

#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/zip_bytes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace semrover {
namespace engine_splat_files_test {

Splats random_splats(size_t n)
{
    std::mt19937 random(5);
    std::normal_distribution<float> normal;
    std::uniform_real_distribution<float> uniform(0.02f, 0.98f);
    Splats s;
    for (size_t i = 0; i < n; ++i) {
        std::array<float, 3> direction = {normal(random), normal(random), normal(random)};
        const float length = std::hypot(direction[0], direction[1], direction[2]);
        for (float& c : direction)
            c /= length;
        s.normal.push_back(direction);
        s.position.push_back({30 * normal(random), 30 * normal(random), normal(random)});
        s.color.push_back({uniform(random), uniform(random), uniform(random)});
        s.sigma_u.push_back(uniform(random));
        s.sigma_v.push_back(0.3f * uniform(random));
        s.opacity.push_back(uniform(random));
        s.label.push_back(static_cast<uint8_t>(i % 20));
    }
    return s;
}

struct Tolerance {
    float position = 0, normal = 2e-6f, color = 1e-6f, sigma = 2e-6f, opacity = 1e-6f;
};

void expect_near(const Splats& a, const Splats& b, const Tolerance& t, bool labels)
{
    ASSERT_EQ(a.position.size(), b.position.size());
    for (size_t i = 0; i < a.position.size(); ++i) {
        for (size_t c = 0; c < 3; ++c) {
            EXPECT_NEAR(a.position[i][c], b.position[i][c], t.position);
            EXPECT_NEAR(a.normal[i][c], b.normal[i][c], t.normal);
            EXPECT_NEAR(a.color[i][c], b.color[i][c], t.color);
        }
        EXPECT_NEAR(a.sigma_u[i] / b.sigma_u[i], 1, t.sigma);
        EXPECT_NEAR(a.sigma_v[i] / b.sigma_v[i], 1, t.sigma);
        EXPECT_NEAR(a.opacity[i], b.opacity[i], t.opacity);
        EXPECT_EQ(a.label[i], labels ? b.label[i] : kNoLabel);
    }
}

// ---- PLY

TEST(SplatPly, splats_come_back_from_every_variant)
{
    const ScratchFolder folder;
    const Splats s = random_splats(200);
    for (const SplatPly variant : {SplatPly::gaussian_3d, SplatPly::gaussian_2d, SplatPly::inria_62})
        for (const bool labels : {false, true}) {
            ASSERT_TRUE(write_splats_ply(folder / "s.ply", s, variant, labels));
            const auto file = read_splats_ply(folder / "s.ply");
            ASSERT_TRUE(file) << file.error().message;
            EXPECT_TRUE(file->warnings.empty());
            expect_near(file->splats, s, {}, labels);
        }
}

// what is shown after the half turn about z of the viewers is what the .glb shows, and no splat changes its shape
TEST(SplatPly, viewers_get_their_axes)
{
    const ScratchFolder folder;
    Splats s = random_splats(200);
    s.normal[0] = {0, 0, 1}; // two equal numbers: the tangents of the turned normal are others
    s.normal[1] = {0, 1, 0};
    s.normal[2] = {-1, 0, 0};
    const float third = std::sqrt(1 / 3.f);
    s.normal[3] = {third, third, third};
    const Splats turned = turned_for_viewers(s);
    ASSERT_TRUE(write_splats_ply(folder / "s.ply", turned, SplatPly::gaussian_3d));
    ASSERT_TRUE(write_splats_glb(folder / "s.glb", s));
    const auto shown = read_splats_ply(folder / "s.ply"), world = read_splats_glb(folder / "s.glb");
    ASSERT_TRUE(shown && world);
    const auto covariance = [](const Splats& from, size_t i) {
        const Tangents t = tangents_of(from.normal[i]);
        std::array<float, 9> c{};
        for (size_t row = 0; row < 3; ++row)
            for (size_t col = 0; col < 3; ++col)
                c[3 * row + col] = from.sigma_u[i] * from.sigma_u[i] * t.u[row] * t.u[col] +
                                   from.sigma_v[i] * from.sigma_v[i] * t.v[row] * t.v[col];
        return c;
    };
    constexpr size_t kAxis[3] = {1, 2, 0}; // of the world, in the file's x, y, z
    constexpr float kSign[3] = {1, -1, -1};
    for (size_t i = 0; i < s.position.size(); ++i) {
        const auto before = covariance(world->splats, i), after = covariance(shown->splats, i);
        for (size_t a = 0; a < 3; ++a) {
            EXPECT_NEAR(shown->splats.position[i][a], kSign[a] * s.position[i][kAxis[a]], 1e-5);
            EXPECT_NEAR(shown->splats.normal[i][a], kSign[a] * s.normal[i][kAxis[a]], 2e-6);
            for (size_t b = 0; b < 3 && i != 3; ++b) // the corner of a cube has no tangents that turn with it
                EXPECT_NEAR(after[3 * a + b], kSign[a] * kSign[b] * before[3 * kAxis[a] + kAxis[b]], 2e-5) << i;
        }
    }
    EXPECT_GT(shown->splats.sigma_u[3], 0);
}

TEST(SplatPly, the_rigid_variant_has_the_62_floats_of_the_first_program)
{
    const ScratchFolder folder;
    const Splats s = random_splats(3);
    ASSERT_TRUE(write_splats_ply(folder / "s.ply", s, SplatPly::inria_62));
    const auto file = read_ply(folder / "s.ply");
    ASSERT_TRUE(file) << file.error().message;
    const std::vector<PlyProperty>& p = file->elements[0].properties;
    ASSERT_EQ(p.size(), 62u);
    EXPECT_EQ(p[5].name, "nz");
    EXPECT_EQ(p[8].name, "f_dc_2");
    for (size_t i = 0; i < 45; ++i) {
        EXPECT_EQ(p[9 + i].name, fmt::format("f_rest_{}", i));
        ASSERT_EQ(p[9 + i].values.size(), 3u);
        for (size_t row = 0; row < 3; ++row)
            EXPECT_EQ(p[9 + i].values[row], 0);
    }
    EXPECT_EQ(p[54].name, "opacity");
    EXPECT_EQ(p[57].name, "scale_2");
    EXPECT_EQ(p[58].name, "rot_0");
    EXPECT_EQ(contents(folder / "s.ply").size() - contents(folder / "s.ply").find("end_header\n") - 11, 3u * 248);
}

std::string splat_ply(const std::string& properties, const std::vector<std::string>& rows)
{
    std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n", rows.size());
    for (size_t at = 0; at < properties.size();) {
        const size_t end = std::min(properties.find(' ', at), properties.size());
        text += "property float " + properties.substr(at, end - at) + "\n";
        at = end + 1;
    }
    text += "end_header\n";
    for (const std::string& row : rows)
        text += row + "\n";
    return text;
}

constexpr const char* kProperties =
    "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 f_dc_0 f_dc_1 f_dc_2 z y x";

TEST(SplatPly, properties_in_any_order_mean_what_the_first_program_wrote)
{
    const ScratchFolder folder;
    // turned by 120 degrees about (1, 1, 1): x to y, y to z, z to x. The smallest scale is y's, so the normal is z, and
    // the extents are x's 0.2 along y and z's 0.05 along x
    const std::string row =
        fmt::format("0 {} {} {} 2 2 2 2 -1 0 1 3 2 1", std::log(0.2), std::log(0.001), std::log(0.05));
    const auto file = read_splats_ply(folder.put("s.ply", splat_ply(kProperties, {row})));
    ASSERT_TRUE(file) << file.error().message;
    const Splats& s = file->splats;
    EXPECT_EQ(s.position[0], (std::array<float, 3>{1, 2, 3}));
    for (size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(s.normal[0][c], c == 2, 1e-6);
    // tangents of z: u = -y, v = x
    EXPECT_NEAR(s.sigma_u[0], 0.2, 1e-6);
    EXPECT_NEAR(s.sigma_v[0], 0.05, 1e-6);
    EXPECT_EQ(s.opacity[0], 0.5f);
    EXPECT_NEAR(s.color[0][0], 0.5 - 0.28209479, 1e-6);
    EXPECT_EQ(s.color[0][1], 0.5f);
    EXPECT_EQ(s.label[0], kNoLabel);
    EXPECT_TRUE(file->warnings.empty());
}

TEST(SplatPly, what_a_flat_splat_cannot_be_is_counted)
{
    const ScratchFolder folder;
    const std::string thin = fmt::format("{}", std::log(1e-4));
    const double h = std::numbers::sqrt2 / 2, c = std::cos(std::numbers::pi / 8), s = std::sin(std::numbers::pi / 8);
    const auto row = [&](double su, double sv, const std::string& sw, const std::string& q, const std::string& x) {
        return fmt::format("0 {} {} {} {} 0 0 0 0 0 {}", std::log(su), std::log(sv), sw, q, x);
    };
    const std::string across = fmt::format("{} 0 0 {}", c, s), quarter = fmt::format("{} 0 0 {}", h, h);
    const auto file = read_splats_ply(
        folder.put("s.ply", splat_ply(kProperties, {row(0.2, 0.1, thin, quarter, "1"),   // along the tangents
                                                    row(0.2, 0.1, thin, across, "2"),    // 45 degrees across
                                                    row(0.1, 0.1, thin, across, "3"),    // round
                                                    row(0.2, 0.2, "-2", "1 0 0 0", "4"), // thick: exp(-2) = 0.135
                                                    row(0.2, 0.2, thin, "0 0 0 0", "5"), // no rotation
                                                    row(0.2, 0.2, thin, "1 0 0 0", "nan"),
                                                    row(0.2, 1e-300, "-1000", "1 0 0 0", "6"), // no size as a float
                                                    row(0.2, 0.2, "-inf", "1 0 0 0", "7")})));
    ASSERT_TRUE(file) << file.error().message;
    std::vector<float> kept;
    for (const auto& p : file->splats.position)
        kept.push_back(p[0]);
    EXPECT_EQ(kept, (std::vector<float>{1, 2, 3, 4, 7}));
    EXPECT_EQ(file->dropped, 3u);
    EXPECT_EQ(
        file->warnings,
        (std::vector<std::string>{
            "2 splats that are not finite, or without a rotation, are left out", "1 splats without a size are left out",
            "1 splats are longer than wide and lie across the tangents: drawn with the same extent along these",
            "1 splats are thick: drawn flat"}));
    // across at 45 degrees: the extent along each tangent is sqrt((0.2^2 + 0.1^2) / 2)
    EXPECT_NEAR(file->splats.sigma_u[1], std::sqrt(0.025), 1e-6);
    EXPECT_NEAR(file->splats.sigma_v[1], std::sqrt(0.025), 1e-6);
    EXPECT_NEAR(file->splats.sigma_u[2], 0.1, 1e-6);
}

TEST(SplatPly, higher_harmonics_are_counted_and_rgb_is_taken)
{
    const ScratchFolder folder;
    const std::string properties =
        "x y z scale_0 scale_1 rot_0 rot_1 rot_2 rot_3 opacity f_dc_0 f_dc_1 f_dc_2 f_rest_0";
    const auto harmonics = read_splats_ply(folder.put(
        "s.ply", splat_ply(properties, {"0 0 0 -3 -3 1 0 0 0 0 0 0 0 0", "0 0 0 -3 -3 1 0 0 0 0 0 0 0 0.1"})));
    ASSERT_TRUE(harmonics) << harmonics.error().message;
    EXPECT_EQ(harmonics->warnings,
              std::vector<std::string>{"1 splats change their colour with the direction: drawn in the mean"});
    const auto rgb = read_splats_ply(
        folder.put("s.ply", splat_ply("x y z scale_0 scale_1 rot_0 rot_1 rot_2 rot_3 opacity red green blue",
                                      {"0 0 0 -3 -3 1 0 0 0 0 0.25 1 0"})));
    ASSERT_TRUE(rgb) << rgb.error().message;
    EXPECT_EQ(rgb->splats.color[0], (std::array<float, 3>{0.25f, 1, 0}));
    const auto large = read_splats_ply(
        folder.put("s.ply", splat_ply("x y z scale_0 scale_1 rot_0 rot_1 rot_2 rot_3 opacity red green blue",
                                      {"0 0 0 -3 -3 1 0 0 0 0 51 255 0"})));
    ASSERT_TRUE(large) << large.error().message;
    EXPECT_EQ(large->splats.color[0], (std::array<float, 3>{0.2f, 1, 0}));
}

TEST(SplatPly, labels_of_other_programs_are_said_or_left_out)
{
    const ScratchFolder folder;
    const auto read = [&](const char* first, const char* second) {
        const std::string properties =
                              "x y z scale_0 scale_1 rot_0 rot_1 rot_2 rot_3 opacity f_dc_0 f_dc_1 f_dc_2 label",
                          row = "0 0 0 -3 -3 1 0 0 0 0 0 0 0 ";
        return read_splats_ply(folder.put("s.ply", splat_ply(properties, {row + first, row + second}))).value();
    };
    const SplatFile ours = read("2", "255");
    EXPECT_EQ(ours.splats.label, (std::vector<uint8_t>{2, kNoLabel}));
    ASSERT_EQ(ours.warnings.size(), 1u);
    EXPECT_NE(ours.warnings[0].find("taken for our own classes: 2 building (1 splats)"), std::string::npos);
    const SplatFile foreign = read("2", "40");
    EXPECT_EQ(foreign.splats.label, (std::vector<uint8_t>{kNoLabel, kNoLabel}));
    ASSERT_EQ(foreign.warnings.size(), 1u);
    EXPECT_NE(foreign.warnings[0].find("unknown labels: 40 (1 splats); all labels are left out"), std::string::npos);
}

TEST(SplatPly, refuses_malformed_files)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& text) { return read_splats_ply(folder.put("m.ply", text)); };
    const auto without = [&](const std::string& name) {
        std::string properties = kProperties;
        properties.replace(properties.find(name), name.size(), "other");
        return read(splat_ply(properties, {"0 0 0 0 1 0 0 0 0 0 0 0 0 0"}));
    };
    EXPECT_TRUE(says(read_splats_ply(folder / "none.ply"), "none.ply"));
    EXPECT_TRUE(says(read(""), "expected 'ply'"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\nelement p 0\nend_header\n"), "has no element vertex"));
    EXPECT_TRUE(says(without("x"), "splats need a property x"));
    EXPECT_TRUE(says(without("scale_1"), "splats need the properties scale_0 and scale_1"));
    EXPECT_TRUE(says(without("rot_3"), "splats need a property rot_3"));
    EXPECT_TRUE(says(without("opacity"), "splats need a property opacity"));
    EXPECT_TRUE(says(without("f_dc_1"), "splats need a property f_dc_1"));
    EXPECT_TRUE(says(read("ply\nformat ascii 1.0\nelement vertex 0\nproperty list int float x\nproperty float y\n"
                          "property float z\nend_header\n"),
                     "property x is a list"));
    EXPECT_TRUE(says(read(splat_ply(kProperties, {})), "no splat is left of 0"));
    EXPECT_TRUE(says(read(splat_ply(kProperties, {"nan 0 0 0 1 0 0 0 0 0 0 0 0 0"})), "no splat is left of 1"));
    EXPECT_TRUE(
        says(read(splat_ply(kProperties, {"0.25 1.23456789 1.23456789 1.23456789"})), "the row ends before 'rot_0'"));
    ASSERT_TRUE(write_splats_ply(folder / "s.ply", random_splats(2), SplatPly::gaussian_2d));
    const std::string bytes = contents(folder / "s.ply");
    for (size_t n = 0; n < bytes.size(); ++n)
        EXPECT_FALSE(read(bytes.substr(0, n))) << n;
}

// ---- .splat

TEST(DotSplat, has_32_bytes_a_splat)
{
    const ScratchFolder folder;
    Splats s = random_splats(1);
    s.position[0] = {1, 2, 3};
    s.normal[0] = {0, 0, 1}; // u = -y, v = x: turned by -90 degrees about z
    s.sigma_u[0] = 0.5f;
    s.sigma_v[0] = 0.25f;
    s.color[0] = {0, 0.5f, 1};
    s.opacity[0] = 0.2f;
    ASSERT_TRUE(write_dot_splat(folder / "s.splat", s));
    std::string expected;
    for (const float f : {1.f, 2.f, 3.f, 0.5f, 0.25f, 1e-4f})
        put32(expected, std::bit_cast<uint32_t>(f));
    // 128 + 128 sqrt(1/2) = 218.5: w up, z down
    expected += std::string("\x00\x80\xff\x33\xdb\x80\x80\x25", 8);
    EXPECT_EQ(contents(folder / "s.splat"), expected);
    const auto file = read_dot_splat(folder / "s.splat");
    ASSERT_TRUE(file) << file.error().message;
    expect_near(file->splats, s, {0, 2e-2f, 2.1e-3f, 1e-2f, 2e-3f}, false);
}

TEST(DotSplat, splats_come_back_as_well_as_bytes_hold_them)
{
    const ScratchFolder folder;
    Splats s = random_splats(300);
    s.sigma_v = s.sigma_u; // a coarse rotation moves variance between the tangents
    ASSERT_TRUE(write_dot_splat(folder / "s.splat", s));
    const auto file = read_dot_splat(folder / "s.splat");
    ASSERT_TRUE(file) << file.error().message;
    // a quaternion of 1/128 steps: half a step in each of 4 numbers turns by up to 2 * 2 * 0.5 / 128 = 0.016
    expect_near(file->splats, s, {0, 0.017f, 2.1e-3f, 1e-3f, 2.1e-3f}, false);
}

TEST(DotSplat, refuses_malformed_files)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& bytes) { return read_dot_splat(folder.put("m.splat", bytes)); };
    EXPECT_TRUE(says(read_dot_splat(folder / "none.splat"), "none.splat"));
    EXPECT_TRUE(says(read_dot_splat(folder.path()), "semrover-test"));
    EXPECT_TRUE(says(read(""), "expected splats of 32 bytes, found 0 bytes"));
    EXPECT_TRUE(says(read(std::string(32, '\0')), "no splat is left of 1")); // no size
    std::string one;
    for (const float f : {1.f, 2.f, 3.f, 0.5f, 0.25f, 1e-4f})
        put32(one, std::bit_cast<uint32_t>(f));
    one += std::string("\x00\x80\xff\x33\xdb\x80\x80\x25", 8);
    for (size_t n = 1; n < 32; ++n)
        EXPECT_TRUE(says(read(one + one.substr(0, n)), fmt::format("found {} bytes", 32 + n)));
    const auto with = [&](size_t at, float value) {
        std::string number, bytes = one;
        put32(number, std::bit_cast<uint32_t>(value));
        return read(bytes.replace(at, 4, number));
    };
    ASSERT_TRUE(read(one));
    EXPECT_TRUE(says(with(0, NAN), "no splat is left of 1"));
    EXPECT_TRUE(says(with(8, INFINITY), "no splat is left of 1"));
    EXPECT_TRUE(says(with(12, NAN), "no splat is left of 1"));
    EXPECT_TRUE(says(with(12, -1), "no splat is left of 1"));
    std::string turnless = one;
    turnless.replace(28, 4, "\x80\x80\x80\x80");
    EXPECT_TRUE(says(read(turnless), "no splat is left of 1"));
}

// ---- glTF

std::string glb(const std::string& json, const std::string& binary)
{
    std::string text = json;
    text.append((4 - text.size() % 4) % 4, ' ');
    std::string out = "glTF";
    put32(out, 2);
    put32(out, static_cast<uint32_t>(12 + 8 + text.size() + 8 + binary.size()));
    put32(out, static_cast<uint32_t>(text.size()));
    out += "JSON" + text;
    put32(out, static_cast<uint32_t>(binary.size()));
    return out + std::string("BIN\0", 4) + binary;
}

std::string floats(std::initializer_list<float> values)
{
    std::string out;
    for (const float v : values)
        put32(out, std::bit_cast<uint32_t>(v));
    return out;
}

// one splat: a quantised rotation and opacity, a stride, a node that moves, turns and scales it
const std::string kBinary = floats({1, 2, 3, 99}) + std::string("\0\0\0\x7f", 4) + floats({0.1f, 0.2f, 0.001f}) +
                            std::string("\x80\0\0\0", 4) + floats({0, 1, -1});

Json hand_made()
{
    return json_of(R"({
      "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_gaussian_splatting"], "scene": 0,
      "scenes": [{"nodes": [0]}],
      "nodes": [{"translation": [10, 0, 0], "children": [1]},
                {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0.7071067811865476, 0, 0.7071067811865476]}],
      "meshes": [{"primitives": [{"mode": 0,
        "attributes": {"POSITION": 0, "KHR_gaussian_splatting:ROTATION": 1, "KHR_gaussian_splatting:SCALE": 2,
                       "KHR_gaussian_splatting:OPACITY": 3, "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0": 4},
        "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}}}]}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 1, "type": "VEC3"},
                    {"bufferView": 1, "componentType": 5120, "normalized": true, "count": 1, "type": "VEC4"},
                    {"bufferView": 2, "componentType": 5126, "count": 1, "type": "VEC3"},
                    {"bufferView": 3, "componentType": 5121, "normalized": true, "count": 1, "type": "SCALAR"},
                    {"bufferView": 3, "byteOffset": 4, "componentType": 5126, "count": 1, "type": "VEC3"}],
      "bufferViews": [{"buffer": 0, "byteLength": 16, "byteStride": 16}, {"buffer": 0, "byteOffset": 16, "byteLength": 4},
                      {"buffer": 0, "byteOffset": 20, "byteLength": 12}, {"buffer": 0, "byteOffset": 32, "byteLength": 16}],
      "buffers": [{"byteLength": 48}]})");
}

TEST(GltfSplats, hidden_nodes_are_left_out_and_instances_are_refused)
{
    const ScratchFolder folder;
    const auto read = [&](const Json& json) { return read_splats_glb(folder.put("s.glb", glb(json.dump(), kBinary))); };
    Json json = hand_made();
    json["nodes"][0]["children"] = {1, 2};
    json["nodes"].push_back({{"mesh", 0}, {"extensions", {{"KHR_node_visibility", {{"visible", true}}}}}});
    ASSERT_TRUE(read(json));
    EXPECT_EQ(read(json)->splats.position.size(), 2u);
    json["nodes"][2]["extensions"]["KHR_node_visibility"]["visible"] = false;
    EXPECT_EQ(read(json)->splats.position.size(), 1u);
    json["nodes"][1]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = 0;
    EXPECT_TRUE(says(read(json), "splats of mesh 0 are repeated by EXT_mesh_gpu_instancing, which is not supported"));
}

TEST(GltfSplats, a_file_by_hand_means_what_the_extension_says)
{
    const ScratchFolder folder;
    const auto file = read_splats_glb(folder.put("s.glb", glb(hand_made().dump(), kBinary)));
    ASSERT_TRUE(file) << file.error().message;
    const Splats& s = file->splats;
    // 2 (1, 2, 3), a quarter turn about y (x to -z, z to x): (6, 4, -2), moved: (16, 4, -2); the world's (-z, -x, y)
    EXPECT_NEAR(s.position[0][0], 2, 1e-5);
    EXPECT_NEAR(s.position[0][1], -16, 1e-5);
    EXPECT_NEAR(s.position[0][2], 4, 1e-5);
    // the normal was the file's z, turned to x: the world's -y
    EXPECT_NEAR(s.normal[0][1], -1, 1e-6);
    // 0.1 was along x, turned to -z: the world's x; 0.2 along y: the world's z. u = x cross -y = -z, v = n cross u = x
    EXPECT_NEAR(s.sigma_u[0], 0.4, 1e-6);
    EXPECT_NEAR(s.sigma_v[0], 0.2, 1e-6);
    EXPECT_NEAR(s.opacity[0], 128 / 255.0, 1e-6);
    EXPECT_NEAR(s.color[0][1], 0.5 + 0.28209479, 1e-6);
    EXPECT_EQ(s.label[0], kNoLabel);
    // without harmonics the fallback colour, which is linear: 0, 1, and 0 for what is below
    Json json = hand_made();
    Json& attributes = json["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = 4;
    attributes.erase("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0");
    const auto fallback = read_splats_glb(folder.put("s.glb", glb(json.dump(), kBinary)));
    ASSERT_TRUE(fallback) << fallback.error().message;
    EXPECT_EQ(fallback->splats.color[0], (std::array<float, 3>{0, 1, 0}));
}

TEST(GltfSplats, splats_come_back)
{
    const ScratchFolder folder;
    Splats s = random_splats(200);
    ASSERT_TRUE(write_splats_glb(folder / "s.glb", s));
    const auto file = read_splats_glb(folder / "s.glb");
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_TRUE(file->warnings.empty());
    expect_near(file->splats, s, {.position = 1e-5f}, true);
    // up is y, and the header says how long it is
    const std::string bytes = contents(folder / "s.glb");
    const Json json =
        json_of(bytes.substr(20, static_cast<unsigned char>(bytes[12]) | static_cast<unsigned char>(bytes[13]) << 8));
    EXPECT_EQ(json["accessors"][0]["max"][1], std::ranges::max(s.position, {}, [](auto& p) { return p[2]; })[2]);
    EXPECT_EQ(json["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
    EXPECT_EQ(json["buffers"][0]["byteLength"], 200 * 4 * (3 + 4 + 4 + 3 + 1 + 3 + 1));
    std::ranges::fill(s.label, kNoLabel);
    ASSERT_TRUE(write_splats_glb(folder / "s.glb", s));
    EXPECT_EQ(contents(folder / "s.glb").find("_LABEL"), std::string::npos);
}

TEST(GltfSplats, refuses_malformed_files)
{
    const ScratchFolder folder;
    const auto read = [&](const std::string& bytes) { return read_splats_glb(folder.put("m.glb", bytes)); };
    const auto with = [&](const char* pointer, const Json& value) {
        Json json = hand_made();
        json[Json::json_pointer(pointer)] = value;
        return read(glb(json.dump(), kBinary));
    };
    const auto without = [&](const char* attribute) {
        Json json = hand_made();
        json["meshes"][0]["primitives"][0]["attributes"].erase(attribute);
        return read(glb(json.dump(), kBinary));
    };
    const std::string good = glb(hand_made().dump(), kBinary);
    EXPECT_TRUE(says(read_splats_glb(folder / "none.glb"), "none.glb"));
    EXPECT_TRUE(says(read("{}"), "no binary glTF file"));
    EXPECT_TRUE(says(read("glTF" + floats({1}) + good.substr(8)), "glTF version 1065353216, expected 2"));
    EXPECT_TRUE(says(read(good + "x"), "its header says"));
    EXPECT_TRUE(says(read(glb("[]", kBinary)), "its JSON is no object"));
    EXPECT_TRUE(says(read(glb("{", kBinary)), "m.glb"));
    EXPECT_TRUE(says(read(glb("{}", kBinary)), "has no splats (KHR_gaussian_splatting); meshes go through voxelize"));
    EXPECT_TRUE(says(with("/meshes/0/primitives/0/mode", 4), "splats must be points (mode 0)"));
    EXPECT_TRUE(says(without("POSITION"), "splats without the attribute POSITION"));
    EXPECT_TRUE(says(without("KHR_gaussian_splatting:SCALE"), "without the attribute KHR_gaussian_splatting:SCALE"));
    EXPECT_TRUE(says(without("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0"), "without the attribute COLOR_0"));
    EXPECT_TRUE(says(with("/accessors/0/bufferView", 9), "POSITION: an accessor without a buffer view"));
    EXPECT_TRUE(says(with("/accessors/0/sparse", Json::object()), "or a sparse one"));
    EXPECT_TRUE(says(with("/accessors/0/type", "VEC4"), "POSITION: expected the type VEC3"));
    EXPECT_TRUE(says(with("/accessors/0/componentType", 5125), "POSITION: expected floats, bytes or shorts"));
    EXPECT_TRUE(says(with("/accessors/0/count", 0), "and at least one"));
    EXPECT_TRUE(says(with("/accessors/0/count", 2), "2 elements of 12 bytes, 16 apart, do not fit 16 bytes from 0"));
    EXPECT_TRUE(says(with("/accessors/0/count", 1099511627775u), "do not fit"));
    EXPECT_TRUE(says(with("/accessors/0/byteOffset", 8), "do not fit"));
    EXPECT_TRUE(says(with("/bufferViews/0/byteStride", 4), "do not fit"));
    EXPECT_TRUE(says(with("/bufferViews/0/byteLength", 64), "POSITION: bytes 0 to 64 of a buffer of 48"));
    EXPECT_TRUE(says(with("/bufferViews/0/byteOffset", 999999999999u), "of a buffer of 48"));
    EXPECT_TRUE(says(with("/bufferViews/0/byteOffset", -1), "a buffer view outside the file's own buffer"));
    EXPECT_TRUE(says(with("/bufferViews/0/buffer", 1), "a buffer view outside the file's own buffer"));
    EXPECT_TRUE(says(with("/nodes/1/scale", {1, 2, 2}), "a node whose scale is not the same along all axes"));
    EXPECT_TRUE(says(with("/nodes/1/scale", {-2, 2, 2}), "or a mirror"));
    EXPECT_TRUE(says(with("/nodes/1/scale", {0, 0, 0}), "a node whose scale"));
    EXPECT_TRUE(says(with("/nodes/1/rotation", {0, 0, 0, 5}), "node 1: no transform"));
    EXPECT_TRUE(says(with("/nodes/1/mesh", 7), "node 1: there is no mesh 7"));
    EXPECT_TRUE(says(with("/nodes/0/children", {0}), "nodes more than 64 deep"));
    EXPECT_TRUE(says(with("/nodes/0/children", {5}), "there is no node 5"));
    EXPECT_TRUE(says(with("/nodes/0/children", {{"a", 1}}), "children: expected an array, found object"));
    EXPECT_TRUE(says(with("/scenes/0/nodes", {{"a", 0}}), "nodes: expected an array, found object"));
    std::string logarithms = kBinary;
    logarithms.replace(20, 4, floats({-3}));
    EXPECT_TRUE(says(read(glb(hand_made().dump(), logarithms)), "splat 0: a scale of -3: an early draft"));
    for (size_t n = 0; n < good.size(); ++n)
        EXPECT_FALSE(read(good.substr(0, n))) << n;
}

} // namespace engine_splat_files_test
} // namespace semrover
