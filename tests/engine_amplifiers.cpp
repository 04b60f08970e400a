// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: posix
// Small files that name much: each is refused, or read, within a stated share of memory (SECURITY.md, Limits)
#include "engine/conditioning/scene_objects.h"
#include "engine/format/labelled_points.h"
#include "engine/format/ply_reader.h"
#include "engine/mesh/mesh_files.h"
#include "engine/mesh/surface_blocks.h"
#include "engine/scene/palette.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"
#include "tools/dataset/scene_readers.h"
#include "tools/dataset/vox_file.h"

#include <cmath>
#include <fstream>
#include <numbers>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace semrover {
namespace engine_amplifiers_test {

// what `work` adds to the memory of this process, MiB, at most; run in a child, so that the peak is its own
template <typename Work>
double added_mib(const Work& work)
{
#ifdef __SANITIZE_ADDRESS__
    return 0; // its own share is larger
#endif
    const pid_t child = fork();
    if (child == 0) {
        rusage before{}, after{};
        getrusage(RUSAGE_SELF, &before);
        work();
        getrusage(RUSAGE_SELF, &after);
        _exit(int(std::min(255l, (after.ru_maxrss - before.ru_maxrss) / 4096))); // KiB, in steps of 4 MiB
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status));
    return 4.0 * WEXITSTATUS(status);
}

std::string repeated(std::string_view text, size_t times)
{
    std::string out;
    for (size_t i = 0; i < times; ++i)
        out += text;
    return out;
}

TEST(Amplifiers, buffers_of_one_file_are_mapped_once)
{
    const ScratchFolder folder;
    std::ofstream(folder / "b.bin").put('x');
    std::filesystem::resize_file(folder / "b.bin", 40 << 20);
    const std::string buffer = R"({"byteLength":41943040,"uri":"./b.bin"},{"byteLength":41943040,"uri":"b.bin"},)";
    const Path file = folder.put("m.gltf", R"({"asset":{"version":"2.0"},"buffers":[)" + repeated(buffer, 100) +
                                               R"({"byteLength":1,"uri":"b.bin"}]})");
    EXPECT_TRUE(says(read_mesh(file), "no faces"));
    EXPECT_LE(added_mib([&] { static_cast<void>(read_mesh(file)); }), 16);
}

// a strip of 1000 vertices, 0.1 m apart, in a buffer of its own
std::string strip_buffer()
{
    std::string bytes;
    for (int i = 0; i < 1000; ++i)
        for (const float x : {0.1f * float(i), float(i % 2), 0.f})
            bytes.append(reinterpret_cast<const char*>(&x), 4);
    return bytes;
}

std::string strips(size_t nodes, size_t primitives)
{
    std::string text = R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":12000,"uri":"s.bin"}],)"
                       R"("bufferViews":[{"buffer":0,"byteLength":12000}],)"
                       R"("accessors":[{"bufferView":0,"componentType":5126,"count":1000,"type":"VEC3"}],)"
                       R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":5})";
    text += repeated(R"(,{"attributes":{"POSITION":0},"mode":5})", primitives - 1);
    return text + R"(]}],"nodes":[{"mesh":0})" + repeated(R"(,{"mesh":0})", nodes - 1) + "]}";
}

TEST(Amplifiers, nodes_and_primitives_repeat_a_mesh_a_limited_number_of_times)
{
    const ScratchFolder folder;
    folder.put("s.bin", strip_buffer());
    EXPECT_EQ(read_mesh(folder.put("m.gltf", strips(100, 2)))->faces.size(), 200u * 998);
    for (const auto& [nodes, primitives] : {std::pair(9000, 1), {1, 9000}}) {
        const Path file = folder.put("m.gltf", strips(size_t(nodes), size_t(primitives)));
        EXPECT_TRUE(says(read_mesh(file), "vertices with those before it, at most 8"));
        if (nodes > 1) {
            EXPECT_LE(added_mib([&] { static_cast<void>(read_mesh(file)); }), 640);
        }
    }
    // a node that is named very often
    const std::string again =
        R"({"asset":{"version":"2.0"},"nodes":[{"children":[1)" + repeated(",1", 300000) + R"(]},{}]})";
    const Path file = folder.put("n.gltf", again);
    EXPECT_TRUE(says(read_mesh(file), "nodes[1]: is the child of two nodes"));
    EXPECT_LE(added_mib([&] { static_cast<void>(read_mesh(file)); }), 64);
}

// a strip whose nodes and primitives are what is given
Path strip_of(const ScratchFolder& folder, const std::string& nodes, const std::string& primitive,
              const std::string& more = "")
{
    folder.put("s.bin", strip_buffer());
    return folder.put("m.gltf", R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":12000,"uri":"s.bin"}],)"
                                R"("bufferViews":[{"buffer":0,"byteLength":12000}],)"
                                R"("accessors":[{"bufferView":0,"componentType":5126,"count":1000,"type":"VEC3"}],)"
                                R"("meshes":[{"primitives":[{)" +
                                    primitive + R"(}]}],"nodes":[{)" + nodes + "}]" + more + "}");
}

TEST(Amplifiers, instances_joints_and_morph_targets_are_counted)
{
    const ScratchFolder folder;
    const std::string node = R"("mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}})";
    const auto refused = [&](const Path& file, const char* what) {
        EXPECT_TRUE(says(read_mesh(file), what));
        EXPECT_LE(added_mib([&] { static_cast<void>(read_mesh(file)); }), 320);
    };
    // meshes of points, which have no vertices
    refused(strip_of(folder, node + repeated("},{" + node, 20000), R"("attributes":{"POSITION":0},"mode":0)"),
            "instances with instances, joints and morphed vertices before them, at most 9");
    std::string joints = "0";
    for (int i = 1; i < 4000; ++i)
        joints += fmt::format(",{}", i);
    refused(strip_of(folder, R"("mesh":0,"skin":0)" + repeated(R"(},{"mesh":0,"skin":0)", 3999),
                     R"("attributes":{"POSITION":0},"mode":0)", R"(,"skins":[{"joints":[)" + joints + "]}]"),
            "joints with instances, joints and morphed vertices before them, at most 8");
    refused(strip_of(folder, R"("mesh":0,"weights":[1)" + repeated(",1", 20000) + "]",
                     R"("attributes":{"POSITION":0},"mode":5,"targets":[{"POSITION":0})" +
                         repeated(R"(,{"POSITION":0})", 20000) + "]"),
            "vertices of morph targets with instances, joints");
}

TEST(Amplifiers, libraries_of_an_obj_are_looked_for_a_limited_number_of_times)
{
    const ScratchFolder folder;
    const Path file =
        folder.put("m.obj", repeated("mtllib a b c d e f g h i j k l m n o p q r s t u v w x y z\n", 5000));
    EXPECT_TRUE(says(read_mesh(file), "line 4097: more than 4096 lines of mtllib"));
}

TEST(Amplifiers, an_image_is_decoded_once_and_all_have_a_budget)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_png_gray8(folder / "flat.png", 8192, 8192, std::vector<uint8_t>(size_t(8192) * 8192)));
    const auto textured = [&](size_t copies, bool one_file) {
        std::string images, textures, materials;
        for (size_t i = 0; i < copies; ++i) {
            if (!one_file)
                std::filesystem::copy_file(folder / "flat.png", folder / fmt::format("{}.png", i));
            const char* comma = i ? "," : "";
            images += fmt::format(R"({}{{"uri":"{}.png"}})", comma, one_file ? "flat" : std::to_string(i));
            textures += fmt::format(R"({}{{"source":{}}})", comma, i);
            materials += fmt::format(R"({}{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{}}}}}}})", comma, i);
        }
        return folder.put("m.gltf", R"({"asset":{"version":"2.0"},"images":[)" + images + R"(],"textures":[)" +
                                        textures + R"(],"materials":[)" + materials + "]}");
    };
    const Path one = textured(200, true);
    EXPECT_TRUE(says(read_mesh(one), "no faces"));
    EXPECT_LE(added_mib([&] { static_cast<void>(read_mesh(one)); }), 260); // 192 are the picture
    EXPECT_TRUE(says(read_mesh(textured(20, false)), "images[1]: 8192 x 8192 pixels, expected at most"));
}

Mesh polygon(double radius, uint32_t corners)
{
    Mesh m;
    m.positions.push_back({0, 0, 0});
    for (uint32_t i = 0; i < corners; ++i) {
        const double angle = 2 * std::numbers::pi * i / corners;
        m.positions.push_back({float(radius * std::cos(angle)), float(radius * std::sin(angle)), 0.3f});
    }
    for (uint32_t i = 1; i + 1 < corners; ++i)
        m.faces.push_back({1, i + 1, i + 2});
    return m;
}

TEST(Amplifiers, large_faces_are_cut_into_a_limited_number_of_pieces)
{
    for (const auto& [radius, corners] : {std::pair(6000., 3u), {2000., 20000u}}) {
        const Mesh m = polygon(radius, corners);
        const std::vector<uint8_t> labels(m.faces.size());
        const auto cut = [&] { return SurfaceBlocks::create(m, labels, 0.6f, "m.obj"); };
        const auto refused = cut();
        EXPECT_TRUE(says(refused, "m.obj: face "));
        EXPECT_TRUE(says(refused, "cut into more than 1048576 pieces of 8 voxels; take a larger voxel size"));
        EXPECT_LE(added_mib([&] { static_cast<void>(cut()); }), 512);
    }
    const Mesh square = polygon(700, 4); // a square kilometre is no problem
    EXPECT_TRUE(SurfaceBlocks::create(square, std::vector<uint8_t>(2), 0.6f, "m.obj"));
}

TEST(Amplifiers, json_has_a_limited_number_of_arrays_and_objects)
{
    const ScratchFolder folder;
    const Path objects = folder.put("o.json", R"({"format":"semrover.objects","version":1,"objects":[)" +
                                                  repeated("[],", 5000000) + "1]}");
    EXPECT_TRUE(says(read_objects(objects), "o.json': more than 4194304 arrays and objects"));
    EXPECT_LE(added_mib([&] { static_cast<void>(read_objects(objects)); }), 512);
    const Path gltf =
        folder.put("m.gltf", R"({"asset":{"version":"2.0"},"extras":[)" + repeated("{},", 2000000) + "1]}");
    EXPECT_TRUE(says(read_mesh(gltf), "m.gltf': more than 1048576 arrays and objects"));
    EXPECT_LE(added_mib([&] { static_cast<void>(read_mesh(gltf)); }), 160);
}

TEST(Amplifiers, a_ply_takes_what_its_types_take)
{
    const ScratchFolder folder;
    const size_t rows = 10000000;
    const Path file = folder.put(
        "p.ply",
        fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty uchar a\nend_header\n", rows));
    std::filesystem::resize_file(file, std::filesystem::file_size(file) + rows);
    EXPECT_TRUE(read_ply(file));
    EXPECT_LE(added_mib([&] { static_cast<void>(read_ply(file)); }), 40); // of which the file's pages are 10
    const Path tiny = folder.put(
        "t.ply",
        fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty uchar x\nproperty uchar y\n"
                    "property uchar z\nproperty uchar label\nend_header\n",
                    2 * rows));
    std::filesystem::resize_file(tiny, std::filesystem::file_size(tiny) + 8 * rows);
    EXPECT_TRUE(says(read_labelled_points(tiny, {}), "t.ply': 20000000 vertices in 800001"));
}

TEST(Amplifiers, models_of_a_vox_are_placed_again_a_limited_number_of_times)
{
    const ScratchFolder folder;
    VoxModel cube{{64, 64, 64}, {}};
    for (int i = 0; i < 64 * 64 * 64; ++i)
        cube.voxels.push_back({uint8_t(i & 63), uint8_t(i >> 6 & 63), uint8_t(i >> 12), 1});
    std::vector<std::array<int64_t, 3>> places;
    for (int i = 0; i < 127; ++i)
        places.push_back({64 * i, 0, 0});
    std::vector<std::array<uint8_t, 3>> colors;
    for (const SemanticClass& c : kPalette)
        colors.push_back(c.color);
    std::vector<VoxModel> models(127, VoxModel{{1, 1, 1}, {{0, 0, 0, 1}}});
    models[0] = cube;
    const auto bytes = encode_vox(models, places, colors);
    std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    ASSERT_TRUE(read_vox(folder.put("whole.vox", text), {}));
    // now all shapes name the cube
    for (size_t at = text.find("nSHP"); at != std::string::npos; at = text.find("nSHP", at + 4))
        for (size_t byte = 0; byte < 4; ++byte) // id, no attributes, one model
            text[at + 12 + 12 + byte] = '\0';
    const Path file = folder.put("again.vox", text);
    EXPECT_TRUE(
        says(read_vox(file, {}), "model 0 of 262144 voxels is placed again: more than 4194304 voxels are repeated"));
}

} // namespace engine_amplifiers_test
} // namespace semrover
