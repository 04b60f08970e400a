// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "engine/scene/grid.h"
#include "engine/scene/scene_points.h"
#include "tests/support/inception_reference.h"
#include "tests/support/jpeg_file.h"
#include "tests/support/json_text.h"
#include "tests/support/pointnet_files.h"
#include "tests/support/program.h"
#include "tools/eval/features.h"

#include <algorithm>
#include <cmath>

namespace semrover {
namespace cli_eval_test {

ProgramResult eval(const std::string& arguments)
{
    return semrover_program("eval " + arguments);
}

void put_tensors(const Path& path, const std::map<std::string, std::pair<std::vector<uint64_t>, std::vector<float>>>& t,
                 const std::map<std::string, std::string>& metadata = {})
{
    std::vector<TensorData> tensors;
    for (const auto& [name, tensor] : t)
        tensors.push_back({name, DType::f32, tensor.first, std::as_bytes(std::span(tensor.second))});
    ASSERT_TRUE(write_safetensors(path, tensors, metadata));
}

void put_image(const Path& path, uint32_t width, uint32_t height, uint32_t seed)
{
    std::filesystem::create_directories(path.parent_path());
    std::mt19937 random(seed);
    std::vector<uint8_t> pixels(size_t(width) * height * 3);
    for (uint8_t& v : pixels)
        v = uint8_t(random());
    ASSERT_TRUE(path.extension() == ".png" ? write_png_rgb8(path, width, height, pixels)
                                           : write_jpeg_rgb8(path, width, height, pixels, 90));
}

void put_grid(const Path& path, uint32_t seed, float spread)
{
    std::mt19937 random(seed);
    VoxelGrid grid;
    grid.voxel_size = 0.5f;
    grid.points_per_voxel = 6;
    for (int i = 0; i < 16; ++i)
        for (int j = 0; j < 8; ++j)
            grid.cells.push_back({i, j, int32_t(random() % 3)});
    grid.labels.assign(grid.cells.size(), 1);
    grid.generated.assign(grid.cells.size(), 1);
    for (size_t i = 0; i < grid.cells.size() * 6 * 3; ++i) {
        grid.points.push_back(float_to_half(spread * (float(random() % 1000) / 1000 - 0.5f)));
        grid.colors.push_back(uint8_t(random()));
    }
    ASSERT_TRUE(write_grid(path, grid));
}

TEST(CliEval, features_in_files_need_no_device)
{
    const ScratchFolder folder;
    put_tensors(folder / "a.safetensors", {{"features", {{2, 1}, {0, 2}}}});
    put_tensors(folder / "b.safetensors", {{"features", {{2, 1}, {1, 3}}}});
    const std::string sets = fmt::format("{} {} -q --json --device none", (folder / "a.safetensors").string(),
                                         (folder / "b.safetensors").string());
    const ProgramResult fid = eval("fid " + sets);
    ASSERT_EQ(fid.code, 0) << fid.err;
    EXPECT_DOUBLE_EQ(json_of(fid.out)["value"], 1); // equal variances, means 1 and 2
    const ProgramResult f3d = eval("f3d " + sets);
    EXPECT_DOUBLE_EQ(json_of(f3d.out)["value"], 1);
    const ProgramResult mmd = eval("mmd --kernel polynomial --degree 1 " + sets);
    ASSERT_EQ(mmd.code, 0) << mmd.err;
    EXPECT_DOUBLE_EQ(json_of(mmd.out)["value"], 1);
    EXPECT_DOUBLE_EQ(json_of(mmd.out)["squared_unbiased"], -1);
    const ProgramResult kid = eval("kid --full --subsets 3 " + sets); // both samples: every subset is everything
    ASSERT_EQ(kid.code, 0) << kid.err;
    const Json report = json_of(kid.out);
    // k = (x y + 1)^3: 1 and 4^3 between different samples of a set; 1, 1, 27, 343 across
    EXPECT_NEAR(report["value"].get<double>(), 1 + 64 - 2 * (1 + 1 + 27 + 343) / 4., 1e-9);
    EXPECT_NEAR(report["full"].get<double>(), report["value"].get<double>(), 1e-9);
    EXPECT_EQ(report["subset_size"], 2);
    EXPECT_EQ(report["a"]["samples"], 2);
}

TEST(CliEval, moments_compare_with_features_and_a_small_set_warns)
{
    const ScratchFolder folder;
    put_tensors(folder / "a.safetensors", {{"mu", {{2}, {1, 0}}}, {"sigma", {{2, 2}, {2, 0, 0, 0}}}});
    put_tensors(folder / "b.safetensors", {{"features", {{2, 2}, {0, 0, 2, 0}}}});
    const std::string sets = (folder / "a.safetensors").string() + " " + (folder / "b.safetensors").string();
    const ProgramResult fid = eval("fid " + sets);
    ASSERT_EQ(fid.code, 0) << fid.err;
    EXPECT_TRUE(fid.out.starts_with("fid 0  (means 0, covariances 0; moments, 2 samples, 2 features)")) << fid.out;
    EXPECT_NE(fid.err.find("warning: 2 samples of 2 features: the covariance is singular"), std::string::npos)
        << fid.err;
    expect_error(eval("kid " + sets), 3, "moments are not enough for kid");
    expect_error(eval("mmd " + sets), 3, "moments are not enough for mmd");
}

TEST(CliEval, folders_of_images_go_through_a_network_and_their_features_are_kept)
{
    const ScratchFolder folder;
    InceptionWeights(32).weights.write(folder / "net.safetensors");
    for (uint32_t i = 0; i < 5; ++i) { // as `render` leaves them
        put_image(folder / fmt::format("a/front/color/{:06}.png", i), 40, 30, i);
        put_image(folder / fmt::format("a/front/label/{:06}.png", i), 7, 7, i);
        put_image(folder / fmt::format("b/{}.jpg", i), 50, 20, 100 + i);
    }
    const std::string features = " --features " + (folder / "net.safetensors").string();
    const std::string sets = (folder / "a").string() + " " + (folder / "b").string() + features;
    const ProgramResult fid = eval("fid --json " + sets + " --save-features " + (folder / "out").string());
    ASSERT_EQ(fid.code, 0) << fid.err;
    const Json report = json_of(fid.out);
    EXPECT_GT(report["value"], 0);
    EXPECT_EQ(report["a"]["samples"], 5);
    EXPECT_EQ(report["b"]["sizes"], Json::parse(R"([{"width": 50, "height": 20, "samples": 5}])"));
    EXPECT_EQ(report["network"]["kind"], "inception_v3");
    // what was kept gives the same figure without a device, and one set of each kind too
    const std::string kept_a = (folder / "out/a.safetensors").string(),
                      kept_b = (folder / "out/b.safetensors").string();
    const ProgramResult again = eval("fid --json --device none " + kept_a + " " + kept_b);
    ASSERT_EQ(again.code, 0) << again.err;
    EXPECT_NEAR(json_of(again.out)["value"].get<double>(), report["value"].get<double>(), 1e-9);
    const ProgramResult mixed = eval("fid --json --batch 2 " + kept_a + " " + (folder / "b").string() + features);
    ASSERT_EQ(mixed.code, 0) << mixed.err;
    EXPECT_EQ(json_of(mixed.out)["value"], report["value"]);
    const std::string set = (folder / "set").string(); // the same images in archives
    EXPECT_EQ(semrover_program("dataset pack -q " + (folder / "a").string() + " -o " + set).code, 0);
    for (const std::string& images : {set, set + "/front/color"})
        EXPECT_EQ(json_of(eval("fid --json " + images + " " + kept_b + features).out)["value"], report["value"]);
    const ProgramResult same = eval("fid --json " + kept_a + " " + kept_a);
    EXPECT_NEAR(json_of(same.out)["value"].get<double>(), 0, 1e-6);
    expect_error(eval("fid " + sets + " --save-features " + (folder / "out").string()), 2,
                 "a.safetensors\' exists; -y");

    folder.put("b/late.jpg", "no image");
    expect_error(eval("kid -q " + sets), 3, "late.jpg");
    put_tensors(folder / "other.safetensors", {{"features", {{3, 1}, {1, 2, 3}}}}, {{"network", "x"}});
    expect_error(eval("fid -q " + kept_a + " " + (folder / "other.safetensors").string()), 3,
                 "has 1: of different networks");
    expect_error(eval("f3d -q " + sets), 3, "a PointNet++ is needed here, this is an Inception v3 network");
}

TEST(CliEval, images_of_a_set_may_have_any_sizes)
{
    const ScratchFolder folder;
    InceptionWeights(32).weights.write(folder / "net.safetensors");
    // eight cameras, sizes in turn: more than are kept ready; and the images of one camera as a set of their own
    for (uint32_t i = 0; i < 24; ++i) {
        put_image(folder / fmt::format("mixed/{:06}.png", i), 40 + i % 8, 30, i);
        put_image(folder / fmt::format("alone/{}/{:06}.png", i % 8, i), 40 + i % 8, 30, i);
    }
    const std::string features = " --features " + (folder / "net.safetensors").string();
    const auto path = [&](const std::string& name) { return (folder / name).string(); };
    const ProgramResult fid = eval("fid -q --json --batch 2 " + path("mixed") + " " + path("alone/1") + features +
                                   " --save-features " + path("kept"));
    ASSERT_EQ(fid.code, 0) << fid.err;
    const Json a = json_of(fid.out)["a"];
    EXPECT_EQ(a["samples"], 24);
    EXPECT_EQ(a["sizes"].size(), 8u);
    EXPECT_EQ(a["sizes"][1], Json::parse(R"({"width": 41, "height": 30, "samples": 3})"));
    const auto kept = read_features(folder / "kept/a.safetensors"), one = read_features(folder / "kept/b.safetensors");
    ASSERT_TRUE(kept && one);
    for (size_t i = 0; i < 3; ++i) // rows lie in the order of the files
        for (size_t c = 0; c < one->cols; ++c)
            ASSERT_EQ(kept->row(8 * i + 1)[c], one->row(i)[c]) << i << " " << c;
    EXPECT_EQ(eval("kid -q --json --subsets 3 " + path("mixed") + " " + path("mixed") + features).code, 0);
}

std::string cloud(const ScenePoints& points, const std::string& type, double scale, bool colored)
{
    std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\n", points.size());
    for (const char* axis : {"x", "y", "z"})
        text += fmt::format("property float {}\n", axis);
    for (const char* color : {"red", "green", "blue"})
        text += colored ? fmt::format("property {} {}\n", type, color) : "";
    text += "end_header\n";
    for (size_t i = 0; i < points.size(); ++i) {
        text += fmt::format("{}", fmt::join(points.positions[i], " "));
        for (size_t c = 0; c < 3 && colored; ++c) {
            const double value = double(points.colors[i][c]) * scale;
            text += fmt::format(" {}", type == "float" ? value : std::round(value));
        }
        text += "\n";
    }
    return text;
}

TEST(CliEval, clouds_of_points_go_through_a_network_of_points)
{
    const ScratchFolder folder;
    write_pointnet(folder / "net.safetensors", tiny_pointnet_config());
    put_grid(folder / "one.sgrid", 1, 0.5f);
    const ScenePoints points = points_of(*read_grid(folder / "one.sgrid"));
    const std::string one = (folder / "one.sgrid").string(), ply = (folder / "clouds/a.ply").string();
    const std::string features = " --features " + (folder / "net.safetensors").string();
    std::filesystem::create_directory(folder / "clouds");
    for (const auto& [type, scale] : {std::pair{"uchar", 255}, {"ushort", 65535}, {"float", 1}}) {
        folder.put("clouds/a.ply", cloud(points, type, scale, true));
        const ProgramResult f3d = eval("f3d -q --json " + one + " " + (folder / "clouds").string() + features);
        ASSERT_EQ(f3d.code, 0) << f3d.err;
        EXPECT_EQ(json_of(f3d.out)["b"]["samples"], 8) << type;
        EXPECT_NEAR(json_of(f3d.out)["value"].get<double>(), 0, 1e-6) << type;
    }
    EXPECT_EQ(eval("mmd -q " + one + " " + ply + features).code, 0);
    folder.put("clouds/a.ply", cloud(points, "float", 255, true));
    expect_error(eval("f3d -q " + one + " " + ply + features), 3, "expected 0 to 1 of a float");
    folder.put("clouds/a.ply", cloud(points, "uchar", 255, false));
    expect_error(eval("f3d -q " + one + " " + ply + features), 3,
                 "a.ply': points without colours, which the network looks at");
    folder.put("clouds/a.ply",
               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
               "float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 "
               "0\n0 1 0\n3 0 1 2\n");
    expect_error(eval("f3d -q " + one + " " + ply + features), 3, "expected a cloud of points, a .ply without faces");
}

TEST(CliEval, grids_go_through_a_network_of_points)
{
    const ScratchFolder folder;
    write_pointnet(folder / "net.safetensors", tiny_pointnet_config());
    std::filesystem::create_directory(folder / "many");
    put_grid(folder / "one.sgrid", 1, 0.5f);
    put_grid(folder / "many/two.sgrid", 2, 0.1f);
    put_grid(folder / "many/three.sgrid", 3, 0.1f);
    folder.put("list.txt", "many/two.sgrid\n\nmany/three.sgrid\r\n");
    const std::string one = (folder / "one.sgrid").string(), many = (folder / "many").string();
    const std::string features = " --features " + (folder / "net.safetensors").string();
    const ProgramResult f3d = eval("f3d -q --json " + one + " " + many + features);
    ASSERT_EQ(f3d.code, 0) << f3d.err;
    const Json report = json_of(f3d.out);
    EXPECT_EQ(report["a"]["samples"], 8); // 8 m x 4 m in chunks of 2 m
    EXPECT_EQ(report["b"]["samples"], 16);
    EXPECT_EQ(report["features"], 10);
    EXPECT_GT(report["value"], 0);
    const ProgramResult listed = eval("f3d -q --json " + one + " " + (folder / "list.txt").string() + features);
    ASSERT_EQ(listed.code, 0) << listed.err;
    EXPECT_NEAR(json_of(listed.out)["value"].get<double>(), report["value"].get<double>(), 1e-6);
    const ProgramResult mmd = eval("mmd -q " + one + " " + many + features);
    ASSERT_EQ(mmd.code, 0) << mmd.err;
    EXPECT_TRUE(mmd.out.starts_with("mmd ")) << mmd.out;
    EXPECT_NE(mmd.out.find("8 chunks, 16 chunks, 10 features"), std::string::npos) << mmd.out;

    expect_error(eval("fid -q " + one + " " + many + features), 3, "an Inception v3 network is needed here");
    expect_error(eval("f3d -q " + one + " " SEMROVER_SOURCE_DIR "/assets/scenes/street.semantic.sgrid" + features), 3,
                 "a semantic grid without points");
    folder.put("list.txt", "many/four.sgrid\n");
    expect_error(eval("f3d -q " + one + " " + (folder / "list.txt").string() + features), 3,
                 "four.sgrid\', which is no file");
    Json config = tiny_pointnet_config();
    config["min_points"] = 400;
    folder.put("net.json", config.dump());
    expect_error(eval("f3d -q " + one + " " + many + features), 3, "0 chunk with 400 points or more (8 with fewer)");
    std::filesystem::remove(folder / "net.json");
    expect_error(eval("f3d -q " + one + " " + many + features), 3, "net.json");
}

TEST(CliEval, what_cannot_be_compared_is_one_clear_line)
{
    const ScratchFolder folder;
    const Path a = folder / "a.safetensors", b = folder / "b.safetensors";
    put_tensors(a, {{"features", {{3, 2}, {0, 1, 2, 3, 4, 5}}}}, {{"network", "x"}});
    const auto with_b = [&](const std::string& metric) { return eval(metric + " " + a.string() + " " + b.string()); };
    expect_error(with_b("fid"), 3, "b.safetensors\': no such file or folder");
    put_tensors(b, {{"features", {{1, 2}, {0, 1}}}});
    expect_error(with_b("fid"), 3, "1 sample, a comparison needs two or more");
    put_tensors(b, {{"features", {{2, 3}, {0, 1, 2, 3, 4, 5}}}});
    expect_error(with_b("kid"), 3, "has 2 features a sample");
    put_tensors(b, {{"features", {{2, 2}, {0, 1, NAN, 3}}}});
    expect_error(with_b("mmd"), 3, "holds nan in row 1, column 0");
    put_tensors(b, {{"features", {{2, 2}, {0, 1, 2, 3}}}}, {{"network", "y"}});
    expect_error(with_b("fid"), 3, "features of different networks: ");
    put_tensors(b, {{"other", {{2, 2}, {0, 1, 2, 3}}}});
    expect_error(with_b("fid"), 3, "expected a tensor \'features\' [N, D]");
    put_tensors(b, {{"features", {{2, 2}, {0, 1, 0, 1}}}});
    expect_error(eval("kid --subset-size 3 " + a.string() + " " + b.string()), 3,
                 "subsets of 3 out of 3 and 2 samples");
    put_tensors(a, {{"features", {{3, 2}, {0, 1, 0, 1, 0, 1}}}});
    expect_error(with_b("mmd"), 3, "their median distance is 0");
    put_grid(folder / "one.sgrid", 1, 0.1f);
    std::filesystem::create_directory(folder / "empty");
    const std::string empty = (folder / "empty").string();
    expect_error(eval("fid " + empty + " " + b.string()), 2, "--features NETWORK.safetensors is needed");
    InceptionWeights(64).weights.write(folder / "net.safetensors");
    const std::string net = " -q --features " + (folder / "net.safetensors").string();
    expect_error(eval("fid " + empty + " " + b.string() + net), 3, "no PNG or JPEG images in it");
    expect_error(eval("fid " + (folder / "one.sgrid").string() + " " + b.string() + net), 3, "expected a folder");
    put_image(folder / "empty/one.png", 8, 8, 1);
    expect_error(eval("fid " + empty + " " + b.string() + net), 3, "1 image, a comparison needs two or more");
    expect_error(eval("fid " + empty + " " + b.string() + " --features " + a.string()), 3, "neither Inception v3");
    expect_error(eval("fid " + b.string()), 2, "B is required");
    expect_error(eval("fid " + a.string() + " " + b.string() + " --batch 0"), 2, "--batch");
    expect_error(eval(""), 2, "subcommand");
}

} // namespace cli_eval_test
} // namespace semrover
