// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// What mesh files say of materials: textures that are named in many ways, and where there is no surface
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/transparency.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_mesh_textures_test {

const std::vector<uint8_t> kRed = {255, 0, 0, 255, 0, 0, 255, 0, 0, 255, 0, 0};

std::string bytes_of_hex(std::string_view hex)
{
    std::string bytes;
    for (size_t i = 0; i < hex.size(); i += 2)
        bytes += char(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16));
    return bytes;
}

// 2 x 2 pixels: the left column (200, 100, 50) and opaque, the right one (10, 20, 30) and transparent
std::string half_png()
{
    return bytes_of_hex(
        "89504e470d0a1a0a0000000d494844520000000200000002080600000072b60d240000001449444154789c63389162f4"
        "9f4b448e8101c6000036f9053397a5f52c0000000049454e44ae426082");
}

// a square of 6 m whose texture is seen once
std::string square(const std::string& library, const std::string& more = "")
{
    return "mtllib " + library +
           "\nv 0 0 0\nv 6 0 0\nv 6 6 0\nv 0 6 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wall\nf 1/1 2/2 3/3 4/4\n" +
           more;
}

Mesh readable(const Path& path, const MeshReadOptions& options = {})
{
    auto m = read_mesh(path, options);
    EXPECT_TRUE(m) << m.error().message;
    return m ? std::move(*m) : Mesh{};
}

bool warns(const Mesh& m, std::string_view text)
{
    return std::ranges::any_of(m.warnings, [&](const std::string& w) { return w.find(text) != std::string::npos; });
}

double area_of(const Mesh& m)
{
    double sum = 0;
    for (size_t f = 0; f < m.faces.size(); ++f)
        sum += face_area(m, f);
    return sum;
}

TEST(MeshTextures, several_libraries_stand_on_a_line_and_names_have_blanks)
{
    const ScratchFolder folder;
    folder.put("a.mtl", "newmtl wall\nKd 1 0 0\n");
    folder.put("b.mtl", "newmtl road\nKd 0 1 0\n");
    folder.put("my walls.mtl", "newmtl wall\nKd 0 0 1\n");
    const auto colors = [&](const std::string& line) {
        const Mesh m = readable(folder.put("m.obj", square(line, "usemtl road\nf 1 2 3\n")));
        std::vector<std::array<float, 3>> out;
        for (const char* name : {"wall", "road"})
            for (const Material& material : m.materials)
                if (material.name == name)
                    out.push_back(material.color);
        return out;
    };
    using Colors = std::vector<std::array<float, 3>>;
    EXPECT_EQ(colors("a.mtl b.mtl"), (Colors{{1, 0, 0}, {0, 1, 0}}));
    EXPECT_EQ(colors("my walls.mtl"), (Colors{{0, 0, 1}, {1, 1, 1}}));
    EXPECT_EQ(colors("my\\ walls.mtl"), (Colors{{0, 0, 1}, {1, 1, 1}}));
    EXPECT_EQ(colors("my\\ walls.mtl b.mtl"), (Colors{{0, 0, 1}, {0, 1, 0}}));
    EXPECT_EQ(colors("b.mtl my walls.mtl"), (Colors{{0, 0, 1}, {0, 1, 0}}));
    const Mesh one = readable(folder.put("m.obj", square("a.mtl none.mtl")));
    EXPECT_EQ(one.materials.at(0).color, (std::array<float, 3>{1, 0, 0}));
    EXPECT_TRUE(warns(one, "'none.mtl' is missing: its materials are white"));
    EXPECT_TRUE(warns(readable(folder.put("m.obj", square("no such.mtl"))), "'no such.mtl' is missing"));
}

TEST(MeshTextures, a_texture_is_found_by_its_last_name_and_in_any_case_beside_the_mesh_alone)
{
    const ScratchFolder folder;
    std::filesystem::create_directories(folder / "scene" / "Maps");
    ASSERT_TRUE(write_png_rgb8(folder / "scene" / "tex.png", 2, 2, kRed));
    ASSERT_TRUE(write_png_rgb8(folder / "scene" / "Maps" / "Wall.PNG", 2, 2, kRed));
    ASSERT_TRUE(write_png_rgb8(folder / "outside.png", 2, 2, kRed));
    const auto with = [&](const std::string& name) {
        folder.put("scene/m.mtl", "newmtl wall\nmap_Kd " + name + "\n");
        return read_mesh(folder.put("scene/m.obj", square("m.mtl")));
    };
    const bool any_case = std::filesystem::exists(folder / "scene/TEX.PNG"); // of the disk, as on Windows
    for (const char* name : {"C:\\Users\\me\\Desktop\\tex.png", "/home/me/tex.png", "../tex.png", "TEX.png",
                             "textures/Tex.PNG", "maps\\wall.png"}) {
        const auto m = with(name);
        ASSERT_TRUE(m) << m.error().message;
        EXPECT_EQ(m->textures.size(), 1u) << name;
        EXPECT_TRUE(any_case || warns(*m, "is taken")) << name;
    }
    EXPECT_TRUE(with("tex.png")->warnings.empty());
    EXPECT_TRUE(says(with("../outside.png"), "refers to '../outside.png', expected a file within its own folder"));
    EXPECT_TRUE(says(with("D:\\none.png"), "expected a file within its own folder; put the file beside the mesh"));
    EXPECT_TRUE(says(with("wall.png"), "which is missing")); // not beside the mesh
    if (folder.link("scene/link.png", folder / "outside.png")) {
        EXPECT_TRUE(says(with("LINK.png"), "leads out of its folder"));
    }
}

TEST(MeshTextures, a_mesh_can_be_read_without_textures_that_are_missing_or_broken)
{
    const ScratchFolder folder;
    folder.put("text.png", "no picture");
    folder.put("m.mtl", "newmtl wall\nKd 0 1 0\nmap_Kd none.png\nnewmtl road\nmap_Kd text.png\n");
    const Path obj = folder.put("m.obj", square("m.mtl", "usemtl road\nf 1/1 2/2 3/3\n"));
    EXPECT_TRUE(says(read_mesh(obj), "`missing_textures` white goes on without"));
    const Mesh m = readable(obj, {.missing_textures = MissingTextures::white});
    EXPECT_TRUE(m.textures.empty());
    EXPECT_EQ(m.materials.at(0).color, (std::array<float, 3>{0, 1, 0}));
    EXPECT_TRUE(warns(m, "refers to 'none.png', which is missing"));
    EXPECT_TRUE(warns(m, "text.png': expected a PNG, JPEG, BMP, HDR or TGA image"));
}

TEST(MeshTextures, options_of_map_kd_place_the_texture_or_are_named)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_rgb8(folder / "tex.png", 2, 2, kRed));
    const auto with = [&](const std::string& options) {
        folder.put("m.mtl", "newmtl wall\nmap_Kd " + options + " tex.png\n");
        return readable(folder.put("m.obj", square("m.mtl")));
    };
    // corners (0, 0), (1, 0), (1, 1) of the file; v of a mesh runs down
    const Mesh m = with("-s 2 3 1 -o 0.25 0.5");
    ASSERT_EQ(m.uvs.size(), 2u);
    EXPECT_EQ(m.uvs[0], (std::array<std::array<float, 2>, 3>{{{0.25f, 0.5f}, {2.25f, 0.5f}, {2.25f, -2.5f}}}));
    EXPECT_TRUE(m.warnings.empty());
    for (const char* quiet : {"-colorspace sRGB", "-blendu on -blendv off", "-clamp on", "-mm 0 1", "-mm 0.0 1.00",
                              "-bm 0.5 -boost 2 -texres 512", "-t 0 0 0", "-imfchan l", "-type sphere", "-o 0 0 0"}) {
        const Mesh plain = with(quiet);
        EXPECT_EQ(plain.textures.size(), 1u) << quiet;
        EXPECT_EQ(plain.uvs[0][1], (std::array<float, 2>{1, 1})) << quiet;
        EXPECT_TRUE(plain.warnings.empty()) << quiet << ": " << plain.warnings[0];
    }
    EXPECT_EQ(with("-clamp on").textures[0].wrap_u, TextureWrap::clamp);
    for (const char* named :
         {"-mm 0.1 2", "-t 0.1", "-cc on", "-colorspace linear", "-sharpness 3 4", "-type cube_top"})
        EXPECT_TRUE(warns(with(named), "line 2: the option " + std::string(named).substr(0, 3))) << named;
}

TEST(MeshTextures, what_an_mtl_makes_transparent_is_no_surface)
{
    const ScratchFolder folder;
    folder.put("half.png", half_png());
    const std::vector<uint8_t> mask = {255, 255, 255, 0, 0, 0, 255, 255, 255, 0, 0, 0};
    ASSERT_TRUE(write_png_rgb8(folder / "mask.png", 2, 2, mask));
    // the square is a wall; a triangle of 18 m^2 is of glass
    const auto with = [&](const std::string& wall, const std::string& glass) {
        folder.put("m.mtl", "newmtl wall\n" + wall + "newmtl glass\n" + glass);
        return readable(folder.put("m.obj", square("m.mtl", "usemtl glass\nf 1/1 2/2 3/3\n")));
    };
    const Mesh glass = with("", "d 0.3\n");
    EXPECT_NEAR(area_of(glass), 36, 1e-6);
    EXPECT_TRUE(warns(glass, "transparent, and so no surface: 'glass' (18 m^2); `opaque` makes it one"));
    EXPECT_NEAR(area_of(with("", "d 0.5\n")), 54, 1e-6);
    EXPECT_NEAR(area_of(with("", "d -halo 0.2\n")), 36, 1e-6);
    EXPECT_NEAR(area_of(with("", "Tr 0.7\n")), 36, 1e-6);
    EXPECT_NEAR(area_of(with("", "Tr 1\n")), 36, 1e-6);
    EXPECT_NEAR(area_of(with("", "Tr 0\n")), 54, 1e-6);
    EXPECT_NEAR(area_of(with("Tr 0\n", "Tr 0.9\n")), 36, 1e-6);
    EXPECT_NEAR(area_of(with("d 1\nTr 1\n", "d 1\nTr 1\n")), 54, 1e-6); // d is the one to take
    const Mesh swapped = with("Tr 1\n", "Tr 0.8\n");                    // else there would be nothing
    EXPECT_NEAR(area_of(swapped), 54, 1e-6);
    EXPECT_TRUE(warns(swapped, "all materials have a Tr of more than 0.5, which is taken for d"));
    // right halves of the square; both ways of writing a mask, and the texture itself
    for (const char* map :
         {"map_d mask.png\n", "map_d half.png\n", "map_Kd half.png\nmap_d half.png\n", "map_d -imfchan r mask.png\n"}) {
        const Mesh m = with(map, "");
        EXPECT_TRUE(has_transparency(m)) << map;
        EXPECT_TRUE(has_surface(m, 0, {0.8, 0.1, 0.1})) << map;  // near the corner (0, 0)
        EXPECT_FALSE(has_surface(m, 0, {0.1, 0.8, 0.1})) << map; // (6, 0)
        EXPECT_NEAR(area_of(opaque_parts(m).mesh), 18 + 18, 0.5) << map;
    }
    // as Blender, three.js and tinyobjloader's users have it: alpha of map_Kd alone is not meant
    const Mesh ignored = with("map_Kd half.png\n", "");
    EXPECT_FALSE(has_transparency(ignored));
    EXPECT_TRUE(warns(ignored, "material 'wall': alpha of map_Kd is ignored; map_d half.png would use it"));
    folder.put("m.mtl", "newmtl wall\nd 0\n");
    EXPECT_TRUE(says(read_mesh(folder.put("m.obj", square("m.mtl"))), "all of it is transparent: 'wall' (36 m^2)"));
    EXPECT_NEAR(area_of(readable(folder / "m.obj", {.opaque = true})), 36, 1e-6);
    folder.put("m.mtl", "newmtl wall\nd 2\n");
    EXPECT_TRUE(says(read_mesh(folder / "m.obj"), "m.mtl': line 2: d 2, expected 0 to 1"));
}

// a quad of 1 m with texture coordinates (0, 1), (1, 1), (1, 0), (0, 0) and vertex alphas of 1, 1, 0, 0
std::string alpha_gltf(const ScratchFolder& folder, const std::string& material, bool colors = false)
{
    std::string bytes;
    for (const float x : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 1.f, 1.f, 0.f, 0.f, 1.f, 0.f, // positions
                          0.f, 1.f, 1.f, 1.f, 1.f, 0.f, 0.f, 0.f,                     // texture coordinates
                          1.f, 1.f, 1.f, 1.f, 1.f, 1.f, 1.f, 1.f, 1.f, 1.f, 1.f, 0.f, 1.f, 1.f, 1.f, 0.f})
        bytes.append(reinterpret_cast<const char*>(&x), 4);
    folder.put("m.bin", bytes);
    folder.put("half.png", half_png());
    return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":
[{"mode":6,"attributes":{"POSITION":0,"TEXCOORD_0":1)" +
           std::string(colors ? R"(,"COLOR_0":2)" : "") + R"(},"material":0}]}],"materials":[{"name":"wall",)" +
           material +
           R"(}],"images":[{"uri":"half.png"}],"textures":[{"source":0}],"buffers":[{"byteLength":144,"uri":"m.bin"}],
"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":32},
{"buffer":0,"byteOffset":80,"byteLength":64}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},
{"bufferView":2,"componentType":5126,"count":4,"type":"VEC4"}]})";
}

TEST(MeshTextures, alpha_of_a_gltf_counts_as_its_mode_says)
{
    const ScratchFolder folder;
    const std::string texture = R"("pbrMetallicRoughness":{"baseColorTexture":{"index":0}})";
    const auto opaque_area = [&](const std::string& material, bool colors = false) {
        const auto m = read_mesh(folder.put("m.gltf", alpha_gltf(folder, material, colors)));
        return m ? area_of(opaque_parts(*m).mesh)
               : m.error().message.find("all of it is transparent") != std::string::npos ? 0
                                                                                         : -1;
    };
    const auto factor = [](double alpha) {
        return fmt::format(R"("pbrMetallicRoughness":{{"baseColorFactor":[1,1,1,{}]}})", alpha);
    };
    EXPECT_NEAR(opaque_area(texture), 1, 1e-6);
    EXPECT_NEAR(opaque_area(texture + R"(,"alphaMode":"OPAQUE")"), 1, 1e-6);
    EXPECT_NEAR(opaque_area(texture + R"(,"alphaMode":"MASK")"), 0.5, 0.02);
    EXPECT_NEAR(opaque_area(texture + R"(,"alphaMode":"BLEND")"), 0.5, 0.02);
    EXPECT_NEAR(opaque_area(texture + R"(,"alphaMode":"MASK","alphaCutoff":0)"), 1, 1e-6);
    EXPECT_NEAR(opaque_area(texture + R"(,"alphaMode":"MASK","alphaCutoff":1.5)"), 0, 1e-6);
    EXPECT_NEAR(opaque_area(factor(0.1)), 1, 1e-6);
    EXPECT_NEAR(opaque_area(factor(0.4) + R"(,"alphaMode":"BLEND")"), 0, 1e-6);
    EXPECT_NEAR(opaque_area(factor(0.6) + R"(,"alphaMode":"BLEND")"), 1, 1e-6);
    EXPECT_NEAR(opaque_area(factor(0.4) + R"(,"alphaMode":"MASK","alphaCutoff":0.4)"), 1, 1e-6);
    EXPECT_NEAR(opaque_area(factor(0.4) + R"(,"alphaMode":"MASK")"), 0, 1e-6);
    // alpha of vertices falls from 1 to 0: down to 0.25 there is a surface; and the left half of that with the texture
    EXPECT_NEAR(opaque_area(factor(1) + R"(,"alphaMode":"MASK","alphaCutoff":0.25)", true), 0.75, 0.02);
    EXPECT_NEAR(opaque_area(texture + R"(,"alphaMode":"MASK","alphaCutoff":0.25)", true), 0.375, 0.02);
    EXPECT_NEAR(opaque_area(factor(1), true), 1, 1e-6);
    // glass that light goes through is a surface
    EXPECT_NEAR(opaque_area(R"("extensions":{"KHR_materials_transmission":{"transmissionFactor":1}})"), 1, 1e-6);
    EXPECT_TRUE(says(read_mesh(folder.put("m.gltf", alpha_gltf(folder, R"("alphaMode":"HALF")"))),
                     "materials[0]: alphaMode: expected OPAQUE, MASK or BLEND, found \"HALF\""));
}

TEST(MeshTextures, a_mesh_without_its_transparent_parts_keeps_labels_and_sources)
{
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {5, 5, 5}};
    m.faces = {{0, 1, 2}, {0, 2, 3}};
    m.uvs = {{{{0, 0}, {1, 0}, {1, 1}}}, {{{0, 0}, {1, 1}, {0, 1}}}};
    m.face_labels = {2, 8};
    m.face_materials = {0, 1};
    m.materials = {{.name = "a"}, {.name = "b", .alpha_cutoff = 0.5f, .alpha_texture = 0}};
    m.textures = {{{2, 1, {9, 9, 9, 9, 9, 9}}, TextureWrap::clamp, TextureWrap::clamp, {0, 255}}};
    ASSERT_TRUE(check_mesh(m, "m"));
    const OpaqueParts parts = opaque_parts(m);
    ASSERT_TRUE(check_mesh(parts.mesh, "m"));
    ASSERT_EQ(parts.sources.size(), parts.mesh.faces.size());
    EXPECT_FALSE(has_transparency(parts.mesh));
    double areas[2] = {0, 0};
    for (size_t f = 0; f < parts.mesh.faces.size(); ++f) {
        areas[parts.sources[f]] += face_area(parts.mesh, f);
        EXPECT_EQ(parts.mesh.face_labels[f], m.face_labels[parts.sources[f]]);
    }
    EXPECT_NEAR(areas[0], 0.5, 1e-6);
    EXPECT_NEAR(areas[1], 0.125, 0.01); // where u is above 0.5
    for (const auto& p : parts.mesh.positions)
        EXPECT_LT(p[2], 1); // the vertex of no face is gone
    m.textures[0].alpha = {1, 2, 3};
    EXPECT_TRUE(says(check_mesh(m, "m"), "texture 0 of 2 x 1 pixels has 3 values of alpha"));
    m.textures[0].alpha = {};
    m.alphas = {1};
    EXPECT_TRUE(says(check_mesh(m, "m"), "arrays disagree: 1 vertices with an alpha, expected 5"));
}

std::string ply(const std::string& vertex, const std::string& face, const std::string& rows)
{
    return "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n" +
           vertex + "element face 2\nproperty list uchar int vertex_indices\n" + face + "end_header\n" + rows;
}

TEST(MeshTextures, labels_of_vertices_become_those_of_faces_by_majority)
{
    const ScratchFolder folder;
    const auto rows = [](int a, int b, int c, int d) {
        return fmt::format("0 0 0 {}\n1 0 0 {}\n1 1 0 {}\n0 1 0 {}\n3 0 1 2\n3 0 2 3\n", a, b, c, d);
    };
    const auto labels = [&](const std::string& text, const MeshLabelMap& map = {}) {
        return readable(folder.put("m.ply", text), {.map = map}).face_labels;
    };
    using Labels = std::vector<uint8_t>;
    EXPECT_EQ(labels(ply("property ushort label\n", "", rows(2, 2, 8, 8))), (Labels{2, 8}));
    EXPECT_EQ(labels(ply("property float scalar_label\n", "", rows(2, 8, 13, 2))), (Labels{2, 2})); // a tie: the lower
    EXPECT_EQ(labels(ply("property int label\n", "", rows(-1, 255, 5, 5))), (Labels{kNoLabel, 5}));
    EXPECT_TRUE(warns(readable(folder / "m.ply"), "the numbers are taken for our own classes"));
    // of faces where both are there
    EXPECT_EQ(labels(ply("property ushort label\n", "property uchar label\n",
                         "0 0 0 2\n1 0 0 2\n1 1 0 2\n0 1 0 2\n3 0 1 2 7\n3 0 2 3 9\n")),
              (Labels{7, 9}));
    const std::string foreign = ply("property float scalar_Classification\n", "", rows(6, 6, 6, 2));
    const auto refused = read_mesh(folder.put("m.ply", foreign));
    EXPECT_TRUE(says(refused, "'scalar_Classification': a column of that name holds numbers of asprs, not ours"));
    EXPECT_TRUE(says(refused, "2 ground (1 vertices, terrain), 6 building (3 vertices)"));
    EXPECT_EQ(labels(foreign, *MeshLabelMap::read("asprs")), (Labels{2, 2}));
    EXPECT_EQ(readable(folder.put("m.ply", foreign), {.labels = false}).face_labels, Labels{});
    const std::string nyu = ply("property ushort label\n", "", rows(1, 1, 40, 31));
    EXPECT_TRUE(says(read_mesh(folder.put("m.ply", nyu)), "unknown labels: 31 (1 vertices), 40 (1 vertices)"));
    EXPECT_EQ(labels(nyu, *MeshLabelMap::read("nyu40")), (Labels{3, 3}));
    const MeshReadOptions occ3d{.map = *MeshLabelMap::read("occ3d")};
    EXPECT_TRUE(
        says(read_mesh(folder / "m.ply", occ3d), "unknown labels, which the map does not say: 31 (1 vertices), 40"));
    std::string half = rows(1, 1, 1, 1);
    half.replace(half.find(" 1\n"), 3, " 1.5\n");
    EXPECT_TRUE(says(read_mesh(folder.put("m.ply", ply("property float label\n", "", half))),
                     "'label': 1 vertices have something else than whole numbers"));
}

} // namespace engine_mesh_textures_test
} // namespace semrover
