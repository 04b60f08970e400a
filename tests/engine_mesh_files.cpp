// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/mesh/mesh_files.h"

#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <cstring>

namespace semrover {
namespace engine_mesh_files_test {

const ImageRgb8 kImage{2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 8, 7}};

Mesh two_faces()
{
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0.5f}, {0, 1, 2}};
    m.colors = {{255, 0, 0}, {0, 255, 0}, {1, 2, 255}, {9, 8, 7}};
    m.faces = {{0, 1, 2}, {0, 2, 3}};
    m.face_labels = {0, 13};
    m.face_materials = {0, 1};
    m.materials = {{"asphalt", {1, 1, 1}, 0}, {"", {0.5f, 0.25f, 0.125f}}};
    m.uvs = {{{{0, 0.25f}, {1, 0}, {2, 1}}}, {}};
    m.textures = {{kImage, TextureWrap::clamp, TextureWrap::mirror}};
    return m;
}

std::array<std::array<float, 3>, 3> corners(const Mesh& m, size_t face)
{
    return {m.positions[m.faces[face][0]], m.positions[m.faces[face][1]], m.positions[m.faces[face][2]]};
}

Mesh readable(const Path& path, UpAxis up = UpAxis::file)
{
    auto m = read_mesh(path, {.up = up});
    EXPECT_TRUE(m) << m.error().message;
    return m ? std::move(*m) : Mesh{};
}

TEST(MeshFiles, a_glb_brings_back_geometry_colours_materials_textures_and_labels)
{
    const ScratchFolder folder;
    const Mesh m = two_faces();
    ASSERT_TRUE(write_glb(folder / "m.glb", m));
    const Mesh r = readable(folder / "m.glb");
    ASSERT_EQ(r.faces.size(), 2u);
    for (size_t f = 0; f < 2; ++f) {
        EXPECT_EQ(corners(r, f), corners(m, f));
        for (size_t c = 0; c < 3; ++c)
            EXPECT_EQ(r.colors[r.faces[f][c]], m.colors[m.faces[f][c]]);
        EXPECT_EQ(r.materials[r.face_materials[f]].color, m.materials[f].color);
    }
    EXPECT_EQ(r.face_labels, m.face_labels);
    EXPECT_EQ(r.uvs[0], m.uvs[0]);
    EXPECT_EQ(r.materials[0].name, "road.asphalt");
    EXPECT_EQ(r.materials[1].name, "car");
    ASSERT_EQ(r.textures.size(), 1u);
    EXPECT_EQ(r.textures[0].image.pixels, kImage.pixels);
    EXPECT_EQ(r.textures[0].wrap_u, TextureWrap::clamp);
    EXPECT_EQ(r.textures[0].wrap_v, TextureWrap::mirror);
    const std::string bytes = contents(folder / "m.glb");
    ASSERT_TRUE(write_glb(folder / "m.glb", m));
    EXPECT_EQ(contents(folder / "m.glb"), bytes);
}

TEST(MeshFiles, a_ply_brings_back_geometry_colours_and_labels)
{
    const ScratchFolder folder;
    const Mesh m = two_faces();
    ASSERT_TRUE(write_mesh_ply(folder / "m.ply", m));
    const Mesh r = readable(folder / "m.ply");
    EXPECT_EQ(r.positions, m.positions);
    EXPECT_EQ(r.colors, m.colors);
    EXPECT_EQ(r.faces, m.faces);
    EXPECT_EQ(r.face_labels, m.face_labels);
}

TEST(MeshFiles, a_broken_mesh_is_not_written)
{
    const ScratchFolder folder;
    Mesh m = two_faces();
    m.faces[1][2] = 4;
    EXPECT_TRUE(says(write_glb(folder / "m.glb", m), "face 1 refers to vertex 4, the mesh has 4"));
    EXPECT_TRUE(says(write_mesh_ply(folder / "m.ply", Mesh{}), "no faces"));
    m = two_faces();
    m.face_labels = {0, 77};
    EXPECT_TRUE(says(check_mesh(m, "x"), "x: unknown labels, expected 0 to 19: 77 (1 faces)"));
    m = two_faces();
    m.uvs[0][1][0] = INFINITY;
    EXPECT_TRUE(says(check_mesh(m, "x"), "face 0 has the texture coordinates"));
    m = two_faces();
    m.colors.pop_back();
    EXPECT_TRUE(says(check_mesh(m, "x"), "arrays disagree: 3 vertex colours, expected 4"));
    m = two_faces();
    m.materials[1].texture = 1;
    EXPECT_TRUE(says(check_mesh(m, "x"), "material 1 refers to texture 1, the mesh has 1"));
    m = two_faces();
    m.textures[0].image.pixels.pop_back();
    EXPECT_TRUE(says(check_mesh(m, "x"), "texture 0 has 2 x 2 pixels in 11 bytes"));
    EXPECT_EQ(folder.entries(), 0u);
}

TEST(MeshFiles, obj_polygons_indices_colours_and_materials_are_read)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_rgb8(folder / "wall paint.png", 2, 2, kImage.pixels));
    folder.put("m.mtl", "newmtl building.001\nKd 1 1 1\nmap_Kd -s 1 1 1 -clamp on wall paint.png\n\nnewmtl grass\n"
                        "Kd 0 1 0\nmap_Ka missing.png\n");
    const Path path = folder.put("m.obj", "# a comment\r\nmtllib m.mtl\r\no thing\nv 0 0 0\nv 2 0 0\nv 2 2 0 1.0\n"
                                          "v 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl building.001\n"
                                          "f 1/1/1 2/2/1 \\\n3/3/1 4/4/1\nusemtl grass\nf -4 -3 -2\nl 1 2\n");
    const Mesh m = readable(path);
    ASSERT_EQ(m.faces.size(), 3u);
    EXPECT_EQ(m.faces[2], (std::array<uint32_t, 3>{0, 1, 2}));
    EXPECT_EQ(m.face_materials, (std::vector<uint32_t>{0, 0, 1}));
    EXPECT_EQ(m.materials[0].texture, 0);
    EXPECT_EQ(m.materials[1].texture, -1);
    EXPECT_EQ(m.materials[1].color, (std::array<float, 3>{0, 1, 0}));
    EXPECT_EQ(m.textures[0].wrap_u, TextureWrap::clamp);
    EXPECT_EQ(m.uvs[0][0], (std::array<float, 2>{0, 1})); // v runs up in the file
    const Mesh up = readable(path, UpAxis::y);
    EXPECT_EQ(up.positions[1], (std::array<float, 3>{0, -2, 0}));
    EXPECT_EQ(up.positions[3], (std::array<float, 3>{0, 0, 2}));
    const Mesh colored = readable(folder.put("c.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nf 1 2 3\n"));
    EXPECT_EQ(colored.colors, (std::vector<std::array<uint8_t, 3>>{{255, 0, 0}, {0, 255, 0}, {0, 0, 128}}));
    EXPECT_TRUE(colored.face_materials.empty());
}

TEST(MeshFiles, a_texture_of_an_obj_may_be_a_bmp)
{
    const ScratchFolder folder;
    std::string bmp(58, '\0'); // one pixel: blue 3, green 2, red 1, padding
    bmp.replace(0, 2, "BM");
    for (const auto& [at, value] :
         {std::pair{10, 54}, {14, 40}, {18, 1}, {22, 1}, {26, 1}, {28, 24}, {54, 3}, {55, 2}, {56, 1}})
        bmp[size_t(at)] = char(value);
    folder.put("a.bmp", bmp);
    folder.put("m.mtl", "newmtl a\nmap_Kd a.bmp\n");
    const Mesh m =
        readable(folder.put("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"));
    EXPECT_EQ(m.textures.at(0).image.pixels, (std::vector<uint8_t>{1, 2, 3}));
}

TEST(MeshFiles, concave_polygons_cover_their_own_area)
{
    const ScratchFolder folder;
    // an L of three unit squares, from the corner where a fan would leave it
    const Mesh m =
        readable(folder.put("l.obj", "v 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nv 0 0 0\nf 1 2 3 4 5 6\n"));
    double sum = 0;
    for (size_t f = 0; f < m.faces.size(); ++f) {
        const auto t = corners(m, f);
        sum += ((t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[1][1] - t[0][1]) * (t[2][0] - t[0][0])) / 2;
        EXPECT_GT(face_area(m, f), 0);
    }
    EXPECT_EQ(m.faces.size(), 4u);
    EXPECT_NEAR(sum, 3, 1e-6);
}

double surface(const Mesh& m)
{
    double sum = 0;
    for (size_t f = 0; f < m.faces.size(); ++f)
        sum += face_area(m, f);
    return sum;
}

// a strip of width 1 that winds around itself, with as many corners as are cut by ears
std::string spiral()
{
    std::string vertices, face = "f";
    double x[256], y[256], area = 0;
    for (int i = 0; i < 256; ++i) {
        const int along = i < 128 ? i : 255 - i;
        const double radius = 0.5 * along + (i < 128 ? 3 : 2), angle = 0.2 * along;
        x[i] = radius * std::cos(angle);
        y[i] = radius * std::sin(angle);
        vertices += fmt::format("v {:.6f} {:.6f} 0\n", x[i], y[i]);
        face += fmt::format(" {}", i + 1);
    }
    for (int i = 0; i < 256; ++i)
        area += (x[i] * y[(i + 1) % 256] - x[(i + 1) % 256] * y[i]) / 2;
    return vertices + face + fmt::format("\n# {:.6f}\n", area);
}

TEST(MeshFiles, a_long_concave_polygon_covers_its_own_area)
{
    const ScratchFolder folder;
    const std::string text = spiral();
    const Mesh m = readable(folder.put("m.obj", text));
    EXPECT_EQ(m.faces.size(), 254u);
    EXPECT_NEAR(surface(m), std::stod(text.substr(text.find('#') + 1)), 1e-3);
}

TEST(MeshFiles, a_face_of_more_corners_than_are_supported_is_refused)
{
    const ScratchFolder folder;
    std::string face;
    for (size_t i = 0; i < 16384; ++i)
        face += " 1 2 3 4";
    const std::string v = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl a b\n";
    const Mesh m = readable(folder.put("m.obj", v + "f" + face + "\n"));
    EXPECT_EQ(m.faces.size(), 65534u);
    EXPECT_TRUE(says(read_mesh(folder.put("m.obj", v + "f" + face + " 1\n")),
                     "line 6: a face of more than 65536 corners, which is not supported"));
    EXPECT_TRUE(says(read_mesh(folder.put("m.obj", v + "f" + face + face + "\n")), "more than 65536 corners"));
    std::string list;
    for (size_t i = 0; i < 65537; ++i)
        list += " 0";
    const std::string ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty "
                            "float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n0 0 0\n";
    EXPECT_TRUE(says(read_mesh(folder.put("m.ply", ply + "65537" + list + "\n")),
                     "face 0 has 65537 corners, at most 65536 are supported"));
}

TEST(MeshFiles, broken_obj_files_are_one_line_that_says_where)
{
    const ScratchFolder folder;
    const std::string v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    folder.put("bad.mtl", "newmtl a\nmap_Kd none.png\n");
    folder.put("text.png", "no picture");
    folder.put("text.mtl", "newmtl a\nmap_Kd text.png\n");
    folder.put("out.mtl", "newmtl a\nmap_Kd ../x.png\n");
    folder.put("kd.mtl", "newmtl a\nKd 1 2 0\n");
    folder.put("early.mtl", "Kd 1 1 0\n");
    for (const auto& [text, error] : std::initializer_list<std::pair<std::string, const char*>>{
             {"", "no faces"},
             {v, "no faces"},
             {v + "f 1 2 4\n", "line 4: refers to vertex 4, there are 3 so far"},
             {v + "f 1 2 -4\n", "line 4: refers to vertex -4"},
             {v + "f 0 1 2\n", "line 4: refers to vertex 0"},
             {v + "f 1 2\n", "line 4: a face of 2 corners"},
             {v + "f 1/1 2/1 3/1\nvt 0 0\n", "line 5: a texture coordinate behind the face of line 4 that names it"},
             {v + "vt 0 0\nf 1/1 2/2 3/1\n", "refers to texture coordinate 2, there are 1"},
             {v + "f 1 2 x\n", "expected the number of a vertex, found 'x'"},
             {v + "f 1 2 99999999999999999999\n", "expected the number of a vertex"},
             {"v 0 0\n", "line 1: a vertex of 2 numbers"},
             {"v 0 0 zero\n", "line 1: expected a number, found 'zero'"},
             {"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0 is at (0, 0, nan)"},
             {"v 0 0 1e39\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0 is at (0, 0, 1e+39)"},
             {"v 0 0 3e6\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "expected at most 2e+06 m across"},
             {"v 0 0 0 1 1 7\n", "the colour 7"},
             {"mtllib /etc/passwd\n", "refers to '/etc/passwd', expected a file within its own folder"},
             {"mtllib ..\\x.mtl\n", "expected a file within its own folder"},
             {"mtllib bad.mtl\n", "bad.mtl': line 2: refers to 'none.png', which is missing"},
             {"mtllib text.mtl\n", "expected a PNG, JPEG, BMP, HDR or TGA image"},
             {"mtllib out.mtl\n", "refers to '../x.png'"},
             {"mtllib kd.mtl\n", "the colour 2"},
             {"mtllib early.mtl\n", "in front of the first newmtl"}})
        EXPECT_TRUE(says(read_mesh(folder.put("m.obj", text)), error)) << text;
    if (folder.link("link.mtl", "/etc/hostname")) {
        EXPECT_TRUE(says(read_mesh(folder.put("m.obj", "mtllib link.mtl\n")), "leads out of its folder"));
    }
    EXPECT_TRUE(says(read_mesh(folder / "none.obj"), "none.obj"));
    EXPECT_TRUE(
        says(read_mesh(folder.put("m.fbx", "solid")), "expected a mesh: .obj, .ply, .stl, .off, .glb or .gltf"));
}

TEST(MeshFiles, what_an_obj_does_not_need_may_be_missing)
{
    const ScratchFolder folder;
    const Mesh m = readable(folder.put(
        "m.obj", "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl building\nf 1/1/1 2/1/1 3/1/1\nf 3/1 2/1 1/1\n"));
    ASSERT_EQ(m.faces.size(), 2u);
    EXPECT_EQ(m.materials.at(m.face_materials[0]).name, "building"); // labels come from names
    EXPECT_TRUE(m.uvs.empty());
    ASSERT_EQ(m.warnings.size(), 2u);
    EXPECT_NE(m.warnings[0].find("m.obj': line 1: 'none.mtl' is missing: its materials are white"), std::string::npos);
    EXPECT_NE(m.warnings[1].find("line 6: faces name texture coordinates, the file has none"), std::string::npos);
    // a broken link is no file that is missing
    if (folder.link("dead.mtl", "/nowhere")) {
        EXPECT_TRUE(
            says(read_mesh(folder.put("m.obj", "mtllib dead.mtl\n")), "refers to 'dead.mtl', which is missing"));
    }
}

std::string binary_stl(const std::string& header, uint32_t says, size_t facets)
{
    std::string bytes = header;
    bytes.resize(80, ' ');
    bytes.append(reinterpret_cast<const char*>(&says), 4);
    for (size_t f = 0; f < facets; ++f) {
        for (const float x : {0.f, 0.f, 1.f, 0.f, 0.f, float(f), 2.f, 0.f, 0.f, 0.f, 3.f, 0.f})
            bytes.append(reinterpret_cast<const char*>(&x), 4);
        bytes += "\xff\x7f";
    }
    return bytes;
}

TEST(MeshFiles, stl_is_read_in_both_kinds)
{
    const ScratchFolder folder;
    for (const char* header : {"a header", "solid that is none"}) {
        const Mesh m = readable(folder.put("m.stl", binary_stl(header, 3, 3)));
        ASSERT_EQ(m.faces.size(), 3u);
        EXPECT_EQ(corners(m, 2), (std::array<std::array<float, 3>, 3>{{{0, 0, 2}, {2, 0, 0}, {0, 3, 0}}}));
        EXPECT_TRUE(m.face_materials.empty());
    }
    const std::string facet = "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 5e-1\n"
                              " endloop\nendfacet\n";
    const Mesh named = readable(
        folder.put("t.stl", "solid building 3\r\n" + facet + facet + "endsolid\nsolid\n" + facet + "endsolid x"));
    ASSERT_EQ(named.faces.size(), 3u);
    EXPECT_EQ(named.face_materials, (std::vector<uint32_t>{0, 0, 1}));
    EXPECT_EQ(named.materials[0].name, "building 3");
    EXPECT_EQ(named.positions[8], (std::array<float, 3>{0, 1, 0.5f}));
    for (const auto& [text, error] : std::initializer_list<std::pair<std::string, const char*>>{
             {"", "expected STL, found 0 bytes"},
             {"text", "expected STL, found 4 bytes"},
             {binary_stl("a", 4, 3), "says it has 4 triangles, there is room for 3"},
             {binary_stl("a", 0xffffffff, 3), "says it has 4294967295 triangles"},
             {binary_stl("a", 0, 0), "no faces"},
             {"solid a\n", "no faces"},
             {"solid a\nfacet\nvertex 0 0\n", "line 3: a vertex of 2 numbers"},
             {"solid a\nfacet\nvertex 0 0 x\n", "line 3: expected a number, found 'x'"},
             {"solid a\nfacet\nvertex 0 0 nan\nvertex 0 0 0\nvertex 1 0 0\nendfacet\n", "vertex 0 is at (0, 0, nan)"},
             {"solid a\nfacet\nvertex 0 0 0\nendfacet\n", "line 4: a facet of 1 vertices"},
             {"solid a\nfacet\nvertex 0 0 0\n", "ends within a facet"},
             {"solid a\nfaces 3\n", "line 2: expected STL, found 'faces'"}})
        EXPECT_TRUE(says(read_mesh(folder.put("m.stl", text)), error)) << text;
}

TEST(MeshFiles, off_is_read_with_colours)
{
    const ScratchFolder folder;
    const std::string square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    const Mesh m = readable(folder.put("m.off", "OFF # a comment\n\n4 3 0\n" + square +
                                                    "4 0 1 2 3 1 0 0\n3 0 1 2 0.0 1.0 0.0 1.0\n3 1 2 3\n"));
    ASSERT_EQ(m.faces.size(), 4u);
    EXPECT_EQ(m.face_materials, (std::vector<uint32_t>{0, 0, 1, 2}));
    EXPECT_EQ(m.materials[0].color, (std::array<float, 3>{1, 0, 0}));
    EXPECT_EQ(m.materials[1].color, (std::array<float, 3>{0, 1, 0}));
    EXPECT_EQ(m.materials[2].color, (std::array<float, 3>{1, 1, 1}));
    using Colors = std::vector<std::array<uint8_t, 3>>;
    const auto colors = [&](const std::string& first, const std::string& second, const std::string& third) {
        const Mesh colored = readable(folder.put("c.off", "COFF 3 1 0\n0 0 0 " + first + "\n1 0 0 " + second +
                                                              "\n0 1 0 " + third + "\n3 0 1 2\n"));
        EXPECT_TRUE(colored.materials.empty());
        return colored.colors;
    };
    EXPECT_EQ(colors("10 20 30 255", "128 0 255 1", "1 2 3 4"), (Colors{{10, 20, 30}, {128, 0, 255}, {1, 2, 3}}));
    // floats, of which whole ones may lack their point; some programs count them to 255
    EXPECT_EQ(colors("1 0 0 1", "0.5 0.0 1.0 1", "0 0 1 1"), (Colors{{255, 0, 0}, {128, 0, 255}, {0, 0, 255}}));
    EXPECT_EQ(colors("128.0 64.0 32.0", "255.0 0 0", "0.5 1 2"), (Colors{{128, 64, 32}, {255, 0, 0}, {1, 1, 2}}));
    for (const auto& [text, error] : std::initializer_list<std::pair<std::string, const char*>>{
             {"", "ends where OFF is expected"},
             {"PLY\n", "line 1: expected OFF, COFF, NOFF or CNOFF, found 'PLY'"},
             {"OFF BINARY\n", "binary OFF"},
             {"OFF\n4\n", "line 2: expected a number up to 268435456, found ''"},
             {"OFF\n4000000000 1 0\n", "found '4000000000'"},
             {"OFF\n0 0 0\n", "no vertices"},
             {"OFF\n200000000 1 0\n" + square, "ends where a vertex is expected"},
             {"OFF\n4 1 0\n" + square, "ends where a face is expected"},
             {"OFF\n4 0 0\n" + square, "no faces"},
             {"OFF\n4 1 0\n" + square + "3 0 1 4\n", "line 7: expected a number up to 3, found '4'"},
             {"OFF\n4 1 0\n" + square + "3 0 1\n", "a face of 3 corners with 2 numbers"},
             {"OFF\n4 1 0\n" + square + "2 0 1\n", "a face of 2 corners"},
             {"OFF\n4 1 0\n" + square + "3 0 1 2 300 0 0\n", "the colour 300"},
             {"NOFF\n1 1 0\n0 0 0\n", "a vertex of 3 numbers, expected 6"},
             {"OFF\n1 1 0\n0 0 inf\n3 0 0 0\n", "vertex 0 is at (0, 0, inf)"}})
        EXPECT_TRUE(says(read_mesh(folder.put("m.off", text)), error)) << text;
}

const std::string kPlyVertices =
    "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\n";
const std::string kSquare = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

TEST(MeshFiles, ply_polygons_textures_and_labels_are_read)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_rgb8(folder / "t.png", 2, 2, kImage.pixels));
    const Mesh m = readable(folder.put("m.ply", kPlyVertices +
                                                    "element face 1\nproperty list uchar int vertex_index\n"
                                                    "property list uchar float texcoord\nproperty int class_id\n"
                                                    "end_header\n" +
                                                    kSquare + "4 0 1 2 3 8 0 0 1 0 1 1 0 1 8\n"));
    ASSERT_EQ(m.faces.size(), 2u);
    EXPECT_EQ(m.face_labels, (std::vector<uint8_t>{8, 8}));
    EXPECT_EQ(m.uvs[1][2], (std::array<float, 2>{0, 0}));
    EXPECT_EQ(m.materials.at(m.face_materials[0]).texture, 0);
    std::string blanks = kPlyVertices; // as MeshLab writes it
    blanks.replace(blanks.find("TextureFile t.png"), 17, "TextureFile   t.png ");
    EXPECT_EQ(readable(folder.put("b.ply", blanks +
                                               "element face 1\nproperty list uchar int vertex_index\n"
                                               "end_header\n" +
                                               kSquare + "3 0 1 2\n"))
                  .textures.size(),
              1u);
    const Path other = folder.put("n.ply", kPlyVertices + "property float s\nproperty float t\nelement face 1\n"
                                                          "property list uchar int vertex_indices\nproperty int label\n"
                                                          "end_header\n0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n"
                                                          "3 0 1 2 77\n");
    EXPECT_TRUE(says(read_mesh(other), "unknown labels: 77 (1 faces); `map` says what they are"));
    const auto map = MeshLabelMap::read(folder.put("map.json", R"({"77": "Terrain", "glass*": null})"));
    ASSERT_TRUE(map) << map.error().message;
    const auto mapped = read_mesh(other, {.map = *map});
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(mapped->face_labels, std::vector<uint8_t>{9});
    EXPECT_EQ(mapped->uvs[0][2], (std::array<float, 2>{1, 0}));
}

TEST(MeshFiles, broken_ply_meshes_are_one_line_that_says_where)
{
    const ScratchFolder folder;
    const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";
    std::string plain = kPlyVertices;
    plain.erase(plain.find("comment"), std::strlen("comment TextureFile t.png\n"));
    for (const auto& [text, error] : std::initializer_list<std::pair<std::string, const char*>>{
             {"", "m.ply"},
             {"ply\nformat ascii 1.0\nend_header\n", "no vertices"},
             {plain + "end_header\n" + kSquare, "no faces"},
             {plain + "element face 0\nproperty list uchar int vertex_indices\nend_header\n" + kSquare, "no faces"},
             {plain + "element face 1\nproperty int a\nend_header\n" + kSquare + "1\n", "no list vertex_indices"},
             {plain + faces + "end_header\n" + kSquare + "3 0 1 4\n", "face 0 refers to vertex 4, the mesh has 4"},
             {plain + faces + "end_header\n" + kSquare + "3 0 1 -1\n", "face 0 refers to vertex -1"},
             {plain + faces + "end_header\n" + kSquare + "2 0 1\n", "face 0 has 2 corners"},
             {plain + faces + "end_header\n" + kSquare, "m.ply"},
             {plain + faces + "end_header\nnan 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n", "nan"},
             {plain + "property float red\nproperty float green\nproperty float blue\n" + faces +
                  "end_header\n0 0 0 0 0 300\n1 0 0 0 0 0\n1 1 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n",
              "the colour 300, expected 0 to 1, or 0 to 255"},
             {plain + faces + "property list uchar float texcoord\nend_header\n" + kSquare + "3 0 1 2 5 0 0 0 0 0\n",
              "face 0 has 5 texture coordinates for 3 corners"},
             {kPlyVertices + faces + "end_header\n" + kSquare + "3 0 1 2\n", "refers to 't.png', which is missing"}})
        EXPECT_TRUE(says(read_mesh(folder.put("m.ply", text)), error)) << text;
}

TEST(MeshFiles, colours_of_a_ply_are_counted_as_their_type_and_size_say)
{
    const ScratchFolder folder;
    for (const auto& [type, color] : {std::pair{"uchar", "128 64 32"},
                                      {"ushort", "32896 16448 8224"},
                                      {"ushort", "128 64 32"},
                                      {"float", "128 64 32"},
                                      {"double", "0.501961 0.25098 0.12549"}}) {
        std::string text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                           "property float z\n";
        for (const char* channel : {"red", "green", "blue"})
            text += fmt::format("property {} {}\n", type, channel);
        const Mesh m = readable(folder.put(
            "m.ply", text + fmt::format("element face 1\nproperty list uchar int vertex_indices\nend_header\n"
                                        "0 0 0 {0}\n1 0 0 {0}\n0 1 0 {0}\n3 0 1 2\n",
                                        color)));
        ASSERT_EQ(m.colors.size(), 3u);
        EXPECT_EQ(m.colors[1], (std::array<uint8_t, 3>{128, 64, 32})) << type << ' ' << color;
        EXPECT_EQ(m.warnings.size(), std::string_view(color) == "128 64 32" && *type == 'u' && type[1] == 's');
    }
}

TEST(MeshFiles, text_may_begin_with_a_byte_order_mark)
{
    const ScratchFolder folder;
    const std::string mark = "\xef\xbb\xbf", square = "v 0 0 0\nv 6 0 0\nv 6 6 0\n";
    folder.put("m.mtl", mark + "newmtl building\nKd 0 1 0\n");
    const Mesh obj = readable(folder.put("m.obj", mark + "mtllib m.mtl\n" + square + "usemtl building\nf 1 2 3\n"));
    EXPECT_EQ(obj.materials.at(0).color, (std::array<float, 3>{0, 1, 0}));
    const Mesh vertex = readable(folder.put("v.obj", mark + square + "v 9 9 0\nf 1 2 3\n"));
    EXPECT_EQ(vertex.positions.size(), 4u);
    EXPECT_EQ(readable(folder.put("m.off", mark + "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")).faces.size(), 1u);
    EXPECT_EQ(readable(folder.put("m.stl", mark +
                                               "solid a\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                                               "endfacet\nendsolid\n" +
                                               std::string(100, ' ')))
                  .faces.size(),
              1u);
    const std::string header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                               "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    EXPECT_EQ(
        readable(folder.put("m.ply", mark + "ply\nformat ascii 1.0\n" + header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"))
            .faces.size(),
        1u);
    for (const char* name : {"w.obj", "w.off", "w.stl", "w.ply", "w.gltf"})
        EXPECT_TRUE(says(read_mesh(folder.put(name, std::string("\xff\xfev\0 \0", 6))), "text in UTF-16")) << name;
}

// a triangle strip of four vertices, as text with its buffer inside: 48 bytes of positions
std::string gltf(const std::string& primitive, const std::string& more = "", const std::string& accessor = "",
                 const std::string& node = R"("mesh":0)")
{
    // (0,0,0) (1,0,0) (0,1,0) (1,1,0)
    return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{)" + node +
           R"(}],"meshes":[{"primitives":[)" + primitive +
           R"(]}],"buffers":[{"byteLength":48,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAACAPwAAgD8AAAAA"}],"bufferViews":[{"buffer":0,"byteLength":48}],"accessors":[{)" +
           (accessor.empty() ? R"("bufferView":0,"componentType":5126,"count":4,"type":"VEC3")" : accessor) + "}]" +
           more + "}";
}
const std::string kStrip = R"({"attributes":{"POSITION":0},"mode":5})";

TEST(MeshFiles, gltf_strips_fans_and_nodes_are_read)
{
    const ScratchFolder folder;
    EXPECT_EQ(readable(folder.put("mark.gltf", "\xef\xbb\xbf" + gltf(kStrip))).faces.size(), 2u);
    const Mesh strip = readable(folder.put("m.gltf", gltf(kStrip)));
    ASSERT_EQ(strip.faces.size(), 2u);
    EXPECT_EQ(strip.positions[1], (std::array<float, 3>{0, -1, 0})); // x right -> y left
    EXPECT_EQ(strip.positions[2], (std::array<float, 3>{0, 0, 1}));
    EXPECT_EQ(strip.faces[1],
              (std::array<uint32_t, 3>{1, 3, 2})); // every second triangle of a strip turns the other way
    const Mesh fan = readable(folder.put("m.gltf", gltf(R"({"attributes":{"POSITION":0},"mode":6})")), UpAxis::z);
    EXPECT_EQ(fan.faces[1], (std::array<uint32_t, 3>{0, 2, 3}));
    EXPECT_EQ(fan.positions[1], (std::array<float, 3>{1, 0, 0}));
    const Mesh list = readable(folder.put("m.gltf", gltf(R"({"attributes":{"POSITION":0}})")));
    EXPECT_EQ(list.faces.size(), 1u);
    const std::string node = R"("children":[1],"translation":[1,2,3]},{"mesh":0,"scale":[-2,1,1],"rotation":[0,0,1,0])";
    const Mesh moved = readable(folder.put("m.gltf", gltf(kStrip, "", "", node)), UpAxis::z);
    EXPECT_NEAR(moved.positions[1][0], 3, 1e-6); // scaled by -2, turned by 180 degrees, moved by 1
    EXPECT_NEAR(moved.positions[2][1], 1, 1e-6);
    EXPECT_EQ(moved.faces[0], (std::array<uint32_t, 3>{0, 2, 1})); // mirrored
    const Mesh labelled = readable(folder.put(
        "m.gltf",
        gltf(
            R"({"attributes":{"POSITION":0},"material":0})",
            R"(,"materials":[{"name":"x","extras":{"label":5},"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1]}}])")));
    EXPECT_EQ(labelled.face_labels, std::vector<uint8_t>{5});
    // a texture that the primitive has no coordinates for, and a colour of an older extension
    ASSERT_TRUE(write_png_rgb8(folder / "t.png", 2, 2, kImage.pixels));
    const Mesh plain = readable(folder.put(
        "m.gltf",
        gltf(
            R"({"attributes":{"POSITION":0},"material":0},{"attributes":{"POSITION":0},"material":1})",
            R"(,"extensionsRequired":["KHR_materials_pbrSpecularGlossiness"],"images":[{"uri":"t.png"}],"textures":[{"source":0}],"materials":[{"name":"car","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}},{"name":"road","extensions":{"KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0.5,0.25,1,1]}}}])")));
    EXPECT_EQ(plain.materials[plain.face_materials[0]].texture, -1);
    EXPECT_EQ(plain.materials[plain.face_materials[0]].name, "car");
    EXPECT_EQ(plain.materials[plain.face_materials[1]].color, (std::array<float, 3>{0.5f, 0.25f, 1}));
    ASSERT_EQ(plain.warnings.size(), 1u);
    EXPECT_NE(plain.warnings[0].find("primitives[0]: has a texture but no TEXCOORD_0"), std::string::npos);
    EXPECT_EQ(labelled.materials[0].color, (std::array<float, 3>{0.5f, 0.25f, 1}));
}

TEST(MeshFiles, broken_gltf_files_are_one_line_that_says_where)
{
    const ScratchFolder folder;
    const auto with = [](const std::string& attributes) { return R"({"attributes":)" + attributes + "}"; };
    const std::string textured = R"({"attributes":{"POSITION":0},"material":0})";
    const std::string material = R"(,"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}])";
    const std::string texture = material + R"(,"textures":[{"source":0}])";
    for (const auto& [text, error] : std::initializer_list<std::pair<std::string, const char*>>{
             {"", "m.gltf"},
             {"{}", "expected glTF of version 2"},
             {R"({"asset":{"version":"1.0"}})", "expected glTF of version 2"},
             {R"({"asset":{"version":"2.0"}})", "no faces"},
             {R"({"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]})",
              "needs the extension 'KHR_draco_mesh_compression'"},
             {R"({"asset":{"version":"2.0"},"nodes":{"a":{}}})", "nodes: expected an array, found object"},
             {R"({"asset":{"version":"2.0"},"scene":0,"scenes":{"nodes":[]}})", "scenes: expected an array"},
             {R"({"asset":{"version":"2.0"},"buffers":7})", "buffers: expected an array, found number"},
             {R"({"asset":{"version":"2.0"},"extensionsRequired":{"a":"KHR_draco_mesh_compression"}})",
              "extensionsRequired: expected an array, found object"},
             {gltf(kStrip, R"(,"materials":{"a":{}})"), "materials: expected an array, found object"},
             {gltf(kStrip, "", "", R"("mesh":0,"children":{"a":1}},{"mesh":0)"),
              "children: expected an array, found object"},
             {gltf(with("{}")), "refers to accessors[-1], there are 1"},
             {gltf(with(R"({"POSITION":7})")), "refers to accessors[7], there are 1"},
             {gltf(R"({"attributes":{"POSITION":0},"mode":9})"), "expected triangles, strips or fans"},
             {gltf(R"({"attributes":{"POSITION":0},"indices":0})"), "indices: expected unsigned numbers"},
             {gltf(R"({"attributes":{"POSITION":0},"material":3})"), "refers to materials[3], there are 0"},
             {gltf(kStrip, "", R"("bufferView":0,"componentType":5126,"count":5,"type":"VEC3")"),
              "5 elements of 12 bytes, 12 apart, from 0 on, in a bufferView of 48"},
             {gltf(kStrip, "", R"("bufferView":0,"componentType":5126,"count":9007199254740993,"type":"VEC3")"),
              "count: expected a whole number"},
             {gltf(kStrip, "", R"("bufferView":0,"byteOffset":-4,"componentType":5126,"count":1,"type":"VEC3")"),
              "from -4 on"},
             {gltf(kStrip, "", R"("bufferView":3,"componentType":5126,"count":4,"type":"VEC3")"),
              "refers to bufferViews[3], there are 1"},
             {gltf(kStrip, "", R"("bufferView":0,"componentType":5126,"count":4,"type":"MAT3")"), "not supported"},
             {gltf(kStrip, "", R"("bufferView":0,"componentType":5126,"count":4,"type":"VEC3","sparse":{})"),
              "accessors[0]: is sparse"},
             {gltf(kStrip, "", R"("componentType":5126,"count":4,"type":"VEC3")"), "has no bufferView"},
             {gltf(kStrip, "", "", R"("mesh":0,"children":[0])"), "nodes[0]: is the child of two nodes, or of itself"},
             {gltf(kStrip, "", "", R"("mesh":0,"rotation":[0,0,0,9])"), "a quaternion of length 9"},
             {gltf(kStrip, "", "", R"("mesh":1)"), "refers to meshes[1], there are 1"},
             {gltf(textured, material), "refers to textures[0], there are 0"},
             {gltf(textured, texture), "refers to images[0], there are 0"},
             {gltf(textured, texture + R"(,"images":[{"uri":"none.png"}])"),
              "images[0]: refers to 'none.png', which is missing"},
             {gltf(textured, texture + R"(,"images":[{"uri":"/etc/passwd"}])"),
              "expected a file within its own folder"},
             {gltf(textured, texture + R"(,"images":[{"uri":"%2e%2e/x.png"}])"),
              "expected a file within its own folder"},
             {gltf(textured, texture + R"(,"images":[{"uri":"http://example.org/x.png"}])"), "which is missing"},
             {gltf(textured, texture + R"(,"images":[{"bufferView":0}])"), "images[0]: expected a PNG or JPEG image"},
             {std::string(100000, '['), "m.gltf"}})
        EXPECT_TRUE(says(read_mesh(folder.put("m.gltf", text)), error)) << text.substr(0, 400);
}

TEST(MeshFiles, a_cut_glb_is_refused_at_every_length)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_glb(folder / "m.glb", two_faces()));
    const std::string bytes = contents(folder / "m.glb");
    for (size_t length = 0; length < bytes.size(); length += length < 40 ? 1 : 97) {
        const auto m = read_mesh(folder.put("cut.glb", bytes.substr(0, length)));
        ASSERT_FALSE(m) << length;
        EXPECT_EQ(m.error().code, ErrorCode::bad_input);
    }
    // every byte of the JSON's start and of both headers changed: an error or a mesh, never a crash
    for (size_t at = 0; at < bytes.size(); at += at < 60 ? 1 : 13) {
        std::string changed = bytes;
        changed[at] = char(changed[at] ^ 0x15);
        (void)read_mesh(folder.put("changed.glb", changed));
    }
}

// ---- docs/formats.md §5.1: files that packaged libraries get wrong

Path library_case(const char* name)
{
    return Path(SEMROVER_SOURCE_DIR) / "tests/data/meshes/inside" / name;
}

TEST(MeshFiles, obj_files_that_libraries_get_wrong_are_read_right_or_refused)
{
    EXPECT_TRUE(says(read_mesh(library_case("range.obj")), "line 5: refers to vertex -9, there are 3 so far"));
    EXPECT_TRUE(says(read_mesh(library_case("range_uv.obj")), "line 6: refers to texture coordinate 9, there are 1"));
    EXPECT_TRUE(says(read_mesh(library_case("number.obj")), "line 2: expected a number, found '1e999'"));
    EXPECT_TRUE(
        says(read_mesh(library_case("climb.obj")), "line 2: refers to '../outside.mtl', expected a file within"));
    EXPECT_NEAR(surface(readable(library_case("concave.obj"))), 2.8, 1e-6);
    EXPECT_NEAR(surface(readable(library_case("joined.obj"))), 1, 1e-6);
    const Mesh names = readable(library_case("names.obj"));
    EXPECT_EQ(names.materials.at(names.face_materials.at(0)).name, "brick wall");
    EXPECT_EQ(readable(library_case("colours.obj")).colors,
              (std::vector<std::array<uint8_t, 3>>{{255, 0, 0}, {255, 255, 255}, {0, 0, 255}}));
}

TEST(MeshFiles, gltf_files_that_libraries_get_wrong_are_read_right_or_refused)
{
    EXPECT_TRUE(says(read_mesh(library_case("accessor.gltf")), "4000 elements of 12 bytes"));
    EXPECT_TRUE(says(read_mesh(library_case("climb.gltf")), "refers to '../outside.bin', expected a file within"));
    EXPECT_TRUE(says(read_mesh(library_case("cycle.gltf")), "nodes[0]: is the child of two nodes, or of itself"));
    EXPECT_TRUE(says(read_mesh(library_case("required.gltf")), "needs the extension 'EXT_unheard_of'"));
    const std::vector<std::array<float, 3>> corners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    EXPECT_EQ(readable(library_case("percent.gltf"), UpAxis::z).positions, corners);
    EXPECT_EQ(readable(library_case("quantized.gltf"), UpAxis::z).positions, corners);
    // u twice as long and v three times, then a quarter turn, then (0.5, 0.25) further
    const Mesh turned = readable(library_case("transform.gltf"));
    const float expected[3][2] = {{0.5f, 0.25f}, {0.5f, -1.75f}, {3.5f, 0.25f}};
    for (size_t c = 0; c < 3; ++c)
        for (size_t a = 0; a < 2; ++a)
            EXPECT_NEAR(turned.uvs.at(0)[c][a], expected[c][a], 1e-6) << c;
}

TEST(MeshFiles, depth_of_a_gltf_costs_no_stack)
{
    const ScratchFolder folder;
    std::string nodes = R"("children":[1])";
    for (size_t i = 2; i <= 20000; ++i)
        nodes += fmt::format(R"(}},{{"children":[{}])", i);
    EXPECT_EQ(readable(folder.put("m.gltf", gltf(kStrip, "", "", nodes + R"(},{"mesh":0)"))).faces.size(), 2u);
    const std::string deep = std::string(200000, '[') + std::string(200000, ']');
    EXPECT_TRUE(says(read_mesh(folder.put("m.gltf", gltf(kStrip, R"(,"extras":)" + deep))), "nested deeper than 64"));
}

TEST(MeshFiles, labels_come_from_names_maps_and_faces)
{
    EXPECT_EQ(class_of_material("Traffic_Light"), 6);
    EXPECT_EQ(class_of_material("building.003"), 2);
    EXPECT_EQ(class_of_material("ROAD LANE 7"), 19);
    EXPECT_EQ(class_of_material("road-3"), 0);
    EXPECT_EQ(class_of_material("trainers"), std::nullopt);
    EXPECT_EQ(class_of_material(""), std::nullopt);
    const ScratchFolder folder;
    const auto map =
        MeshLabelMap::read(folder.put("map.json", R"({"glass*": "building", "glass door": 3, "*tree*": 8})"));
    ASSERT_TRUE(map) << map.error().message;
    Mesh m = two_faces();
    m.faces.push_back({1, 2, 3});
    m.uvs.clear();
    m.face_labels.clear();
    m.face_materials = {0, 1, 2};
    m.materials = {{"Glass_Door"}, {"oak tree 4"}, {"paint"}};
    const auto unknown = label_faces(m, LabelSource::automatic, *map);
    EXPECT_EQ(m.face_labels, (std::vector<uint8_t>{3, 8, kNoLabel}));
    ASSERT_EQ(unknown.size(), 1u);
    EXPECT_EQ(unknown[0].faces, 1u);
    EXPECT_EQ(unlabelled_text(unknown), fmt::format("'paint' (1 faces, {:.4g} m^2)", face_area(m, 2)));
    for (const auto& [text, error] : std::initializer_list<std::pair<const char*, const char*>>{
             {"[]", "expected an object"},
             {R"({"a": "grass"})", "'a': expected a class (name or 0 to 19), null or \"free\", found \"grass\""},
             {R"({"a": 20})", "found 20"},
             {R"({"a": -1})", "found -1"},
             {R"({"a": 1.5})", "found 1.5"},
             {R"({"a": [1]})", "found [1]"}})
        EXPECT_TRUE(says(MeshLabelMap::read(folder.put("map.json", text)), error)) << text;
    const auto kitti = MeshLabelMap::read("semantickitti");
    ASSERT_TRUE(kitti) << kitti.error().message;
    EXPECT_EQ(kitti->find(int64_t(50)), 2);
    EXPECT_EQ(kitti->find("lane_marking"), 19);
    EXPECT_EQ(kitti->find(int64_t(2)), std::nullopt); // no label of theirs, and not ours either
    EXPECT_EQ(kitti->find(int64_t(-1)), kNoLabel);
    EXPECT_EQ(MeshLabelMap().find(2), 2);
    EXPECT_EQ(MeshLabelMap().find(2, true), std::nullopt);
}

} // namespace engine_mesh_files_test
} // namespace semrover
