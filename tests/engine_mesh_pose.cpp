// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// Where the vertices of mesh files are: far from the origin, and where instances, skins and morph targets put them
#include "engine/mesh/mesh_files.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace engine_mesh_pose_test {

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

std::array<double, 3> place(const Mesh& m, size_t vertex)
{
    std::array<double, 3> p;
    for (size_t a = 0; a < 3; ++a)
        p[a] = m.origin[a] + m.positions[vertex][a];
    return p;
}

// within half a millimetre
testing::AssertionResult is_at(const Mesh& m, size_t vertex, const std::array<double, 3>& expected)
{
    const auto p = place(m, vertex);
    for (size_t a = 0; a < 3; ++a)
        if (!(std::abs(p[a] - expected[a]) < 5e-4))
            return testing::AssertionFailure()
                   << fmt::format("vertex {} is at ({}, {}, {}), expected ({}, {}, {})", vertex, p[0], p[1], p[2],
                                  expected[0], expected[1], expected[2]);
    return testing::AssertionSuccess();
}

TEST(MeshPose, map_coordinates_are_kept_to_the_millimetre)
{
    const ScratchFolder folder;
    const std::string corners[3] = {"500123.4562 4649000.1238 12.0004", "500129.4562 4649000.1238 12.0004",
                                    "500129.4562 4649003.5438 15.0004"};
    const std::string ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
                            "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    std::string obj, rows;
    for (const std::string& corner : corners) {
        obj += "v " + corner + "\n";
        rows += corner + "\n";
    }
    for (const Path& file :
         {folder.put("m.obj", obj + "f 1 2 3\n"), folder.put("m.off", "OFF\n3 1 0\n" + rows + "3 0 1 2\n"),
          folder.put("m.ply", ply + rows + "3 0 1 2\n"),
          folder.put("m.stl", "solid a\nfacet\nvertex " + corners[0] + "\nvertex " + corners[1] + "\nvertex " +
                                  corners[2] + "\nendfacet\nendsolid\n")}) {
        const Mesh m = readable(file);
        EXPECT_NE(m.origin[1], 0) << file;
        EXPECT_TRUE(is_at(m, 0, {500123.4562, 4649000.1238, 12.0004})) << file;
        EXPECT_TRUE(is_at(m, 2, {500129.4562, 4649003.5438, 15.0004})) << file;
        // the origin is added behind axes and scale
        const Mesh moved = readable(file, {.origin = {-500123, -4649000, -10}});
        EXPECT_EQ(moved.origin, (std::array<double, 3>{}));
        EXPECT_TRUE(is_at(moved, 0, {0.4562, 0.1238, 2.0004})) << file;
        const Mesh scaled = readable(file, {.up = UpAxis::y, .scale = 0.5, .origin = {1, 2, 3}});
        EXPECT_TRUE(is_at(scaled, 0, {1 - 6.0002, 2 - 250061.7281, 3 + 2324500.0619})) << file;
    }
    const Mesh near = readable(folder.put("m.obj", "v 8192 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
    EXPECT_EQ(near.origin, (std::array<double, 3>{}));
    EXPECT_TRUE(says(read_mesh(folder.put("m.obj", "v 0 0 2e9\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")),
                     "vertex 0 is at (0, 0, 2000000000), expected numbers within 1e+09"));
    EXPECT_TRUE(says(read_mesh(folder.put("m.obj", "v 0 0 3e6\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")),
                     "reaches from 0 to 3000000 m, expected at most 2e+06 m across"));
}

TEST(MeshPose, numbers_behind_the_place_of_an_obj_vertex_are_colour_alpha_or_a_weight)
{
    const ScratchFolder folder;
    const Mesh m = readable(folder.put("m.obj", "v 0 0 0 1 0 0 0.5\nv 1 0 0 0 1 0 1\nv 0 1 0 0 0 1 1\nf 1 2 3\n"));
    EXPECT_EQ(m.colors, (std::vector<std::array<uint8_t, 3>>{{255, 0, 0}, {0, 255, 0}, {0, 0, 255}}));
    EXPECT_TRUE(m.warnings.empty());
    EXPECT_TRUE(readable(folder.put("m.obj", "v 0 0 0 1.0\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n")).warnings.empty());
    EXPECT_TRUE(warns(readable(folder.put("m.obj", "v 0 0 0 2\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")),
                      "vertices have weights other than 1, which are ignored"));
}

// a triangle strip of four vertices, (0, 0, 0) (1, 0, 0) (0, 1, 0) (1, 1, 0), and what else is put into its buffer
class Gltf {
  public:
    Gltf() { add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, 5126, "VEC3", 4); }

    // returns the accessor's number
    template <typename T>
    size_t add(const std::vector<T>& values, int component, const std::string& type, size_t count,
               bool normalized = false)
    {
        while (bytes_.size() % 4)
            bytes_ += '\0';
        views_ += fmt::format(R"({}{{"buffer":0,"byteOffset":{},"byteLength":{}}})", count_ ? "," : "", bytes_.size(),
                              values.size() * sizeof(T));
        accessors_ +=
            fmt::format(R"({}{{"bufferView":{},"componentType":{},"count":{},"type":"{}"{}}})", count_ ? "," : "",
                        count_, component, count, type, normalized ? R"(,"normalized":true)" : "");
        bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
        return count_++;
    }

    Path put(const ScratchFolder& folder, const std::string& nodes, const std::string& primitive = "",
             const std::string& more = "", const std::string& mesh = "") const
    {
        folder.put("m.bin", bytes_);
        return folder.put("m.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[)" +
                                        nodes + R"(],"meshes":[{"primitives":[{"mode":5,"attributes":{"POSITION":0)" +
                                        primitive + "}]" + mesh + "}]" + more +
                                        R"(,"buffers":[{"uri":"m.bin","byteLength":)" + std::to_string(bytes_.size()) +
                                        R"(}],"bufferViews":[)" + views_ + R"(],"accessors":[)" + accessors_ + "]}");
    }

  private:
    std::string bytes_, views_, accessors_;
    size_t count_ = 0;
};

const MeshReadOptions kAsInFile{.up = UpAxis::z};

TEST(MeshPose, node_translations_are_composed_in_double)
{
    const ScratchFolder folder;
    const Path file = Gltf().put(
        folder, R"({"children":[1],"translation":[530000.4,12.1,-180000.3]},{"mesh":0,"translation":[0.0125,0,0.25]})",
        "}");
    EXPECT_TRUE(is_at(readable(file, kAsInFile), 1, {530001.4125, 12.1, -180000.05}));
    EXPECT_TRUE(is_at(readable(file), 1, {180000.05, -530001.4125, 12.1}));
}

TEST(MeshPose, instances_of_a_node_are_moved_turned_and_scaled)
{
    const ScratchFolder folder;
    Gltf g;
    const size_t t = g.add<float>({0, 0, 0, 10, 0, 0, 0, 20, 0}, 5126, "VEC3", 3);
    // none; a quarter about z in bytes and shorts
    const size_t bytes = g.add<int8_t>({0, 0, 0, 127, 0, 0, 90, 90, 0, 0, 90, 90}, 5120, "VEC4", 3, true);
    const size_t shorts =
        g.add<int16_t>({0, 0, 0, 32767, 0, 0, 23170, 23170, 0, 0, 23170, 23170}, 5122, "VEC4", 3, true);
    const size_t s = g.add<float>({1, 1, 1, 2, 2, 2, 1, 3, 1}, 5126, "VEC3", 3);
    for (const size_t r : {bytes, shorts}) {
        const Mesh m = readable(
            g.put(folder,
                  fmt::format(R"({{"mesh":0,"translation":[100,0,0],"extensions":{{"EXT_mesh_gpu_instancing":
{{"attributes":{{"TRANSLATION":{},"ROTATION":{},"SCALE":{},"_ID":0}}}}}}}})",
                              t, r, s),
                  "}",
                  R"(,"extensionsUsed":["EXT_mesh_gpu_instancing"],"extensionsRequired":["EXT_mesh_gpu_instancing"])"),
            kAsInFile);
        ASSERT_EQ(m.positions.size(), 12u);
        EXPECT_TRUE(m.warnings.empty());
        EXPECT_TRUE(is_at(m, 1, {101, 0, 0}));
        EXPECT_TRUE(is_at(m, 4 + 1, {110, 2, 0})); // x of a scale of 2 turned to y
        EXPECT_TRUE(is_at(m, 8 + 2, {97, 20, 0})); // y of a scale of 3 turned to -x
    }
    const auto refused = [&](const std::string& attributes) {
        return read_mesh(g.put(
            folder, R"({"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{)" + attributes + "}}}}", "}"));
    };
    EXPECT_TRUE(says(refused(""), "has no TRANSLATION, ROTATION or SCALE"));
    EXPECT_TRUE(says(refused(R"("TRANSLATION":99)"), "refers to accessors[99]"));
    EXPECT_TRUE(says(refused(fmt::format(R"("TRANSLATION":{})", bytes)), "TRANSLATION: expected 3 floats"));
    EXPECT_TRUE(
        says(refused(fmt::format(R"("TRANSLATION":0,"SCALE":{})", s)), "SCALE has 3 entries, those before it 4"));
}

TEST(MeshPose, a_skinned_mesh_lies_where_its_joints_are)
{
    const ScratchFolder folder;
    Gltf g;
    const size_t joints = g.add<uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, 5121, "VEC4", 4);
    const size_t weights =
        g.add<float>({1, 0, 0, 0, 1, 0, 0, 0, 0.25f, 0.75f, 0, 0, 2, 0, 0, 0}, 5126, "VEC4", 4); // the last is not 1
    // inverse bind matrices, columns: none, and (-1, 0, 0)
    const size_t inverse = g.add<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1, //
                                         1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1},
                                        5126, "MAT4", 2);
    const std::string nodes = R"({"children":[1,2]},{"mesh":0,"skin":0,"translation":[500,0,0]},
{"translation":[0,0,5],"children":[3]},{"translation":[0,7,0],"scale":[2,2,2]})";
    const std::string attributes = fmt::format(R"(,"JOINTS_0":{},"WEIGHTS_0":{}}})", joints, weights);
    const auto skin = [&](const std::string& list) {
        return fmt::format(R"(,"skins":[{{"joints":{},"inverseBindMatrices":{}}}])", list, inverse);
    };
    const Mesh m = readable(g.put(folder, nodes, attributes, skin("[2,3]")), kAsInFile);
    ASSERT_EQ(m.positions.size(), 4u);
    EXPECT_TRUE(is_at(m, 0, {0, 0, 5}));
    EXPECT_TRUE(is_at(m, 1, {0, 7, 5})); // (1, 0, 0) - (1, 0, 0), twice as large, at (0, 7, 5)
    // (0, 1, 0): a quarter at (0, 1, 5), the rest at (-2, 9, 5)
    EXPECT_TRUE(is_at(m, 2, {-1.5, 7, 5}));
    EXPECT_TRUE(is_at(m, 3, {0, 9, 5}));
    EXPECT_TRUE(says(read_mesh(g.put(folder, nodes, attributes, skin("[2]"))), "vertex 1 has joint 1, the skin has 1"));
    EXPECT_TRUE(says(read_mesh(g.put(folder, nodes, attributes, skin("[2,9]"))), "skins[0]: refers to nodes[9]"));
    EXPECT_TRUE(says(read_mesh(g.put(folder, nodes, "}", skin("[2,3]"))), "is skinned and has no JOINTS_0"));
    EXPECT_TRUE(says(read_mesh(g.put(folder, nodes, attributes, skin("[2,3,2,3,2]"))), "skins[0]: has 5 joints"));
}

TEST(MeshPose, morph_targets_move_vertices_by_the_weights_of_the_node_or_the_mesh)
{
    const ScratchFolder folder;
    Gltf g;
    const size_t up = g.add<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 4}, 5126, "VEC3", 4);
    const size_t back = g.add<float>({0, -1, 0, 0, -1, 0, 0, -1, 0, 0, -1, 0}, 5126, "VEC3", 4);
    const std::string targets =
        fmt::format(R"(}},"targets":[{{"POSITION":{}}},{{"NORMAL":0,"POSITION":{}}}])", up, back);
    const auto read = [&](const std::string& node, const std::string& mesh) {
        return readable(g.put(folder, R"({"mesh":0)" + node + "}", targets, "", mesh), kAsInFile);
    };
    EXPECT_TRUE(is_at(read("", ""), 3, {1, 1, 0}));
    EXPECT_TRUE(is_at(read("", R"(,"weights":[0.5,0])"), 3, {1, 1, 2}));
    EXPECT_TRUE(is_at(read(R"(,"weights":[0.25,2])", R"(,"weights":[0.5,0])"), 3, {1, -1, 1}));
    EXPECT_TRUE(is_at(read(R"(,"weights":[1],"scale":[1,1,10])", ""), 0, {0, 0, 10}));
    const std::string wrong = R"(},"targets":[{"POSITION":77}])";
    EXPECT_TRUE(says(read_mesh(g.put(folder, R"({"mesh":0,"weights":[1]})", wrong)), "refers to accessors[77]"));
}

TEST(MeshPose, hidden_nodes_are_left_out_and_unknown_extensions_are_named)
{
    const ScratchFolder folder;
    const Gltf g;
    const std::string nodes = R"({"children":[1,3]},{"extensions":{"KHR_node_visibility":{"visible":false}},
"children":[2]},{"mesh":0},{"mesh":0,"extensions":{"KHR_node_visibility":{"visible":true},"MSFT_lod":{"ids":[4]},
"ACME_bend":{}}},{"mesh":0})";
    const Mesh m = readable(g.put(folder, nodes, R"(},"extensions":{"ACME_hair":{},"KHR_materials_variants":{}})"));
    EXPECT_EQ(m.positions.size(), 4u);
    ASSERT_EQ(m.warnings.size(), 2u);
    EXPECT_TRUE(warns(m, "m.gltf': the extension 'ACME_bend' of nodes or primitives is ignored"));
    EXPECT_TRUE(warns(m, "'ACME_hair'"));
}

} // namespace engine_mesh_pose_test
} // namespace semrover
