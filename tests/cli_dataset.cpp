// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/renderer_folders.h"
#include "tests/support/street_scene.h"
#include "tools/trajectory/camera_path.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <map>

namespace semrover {
namespace cli_dataset_test {

namespace fs = std::filesystem;

std::vector<Path> tree(const Path& folder)
{
    return list_tree(folder).value();
}

ProgramResult run(const std::string& arguments)
{
    ProgramResult result = semrover_program(arguments);
    EXPECT_EQ(result.code, 0) << arguments << "\n" << result.err;
    return result;
}

// bytes of all files below a folder, by their paths from there on
std::map<std::string, std::string> files_of(const Path& folder)
{
    std::map<std::string, std::string> files;
    for (const Path& path : tree(folder))
        files[path.lexically_relative(folder).string()] = contents(path);
    return files;
}

// a rig's drive past a street, in `in`, and as a shard set in `set`
class Drive : public testing::Test {
  protected:
    Drive()
    {
        const StreetScene street;
        CameraPath path;
        std::map<std::string, uint32_t> counts;
        for (const CameraFrame& f : StreetScene::drive(3, 96, 72))
            for (const char* camera : {"front", "left"}) {
                path.frames.push_back(f);
                path.frames.back().camera = camera;
                put_pictures(folder_ / "in" / camera, fmt::format("{:06}", counts[camera]++), street.render(f));
            }
        EXPECT_TRUE(write_transforms(folder_ / "in/transforms.json", path));
        run("dataset pack " + at("in") + " -o " + at("set") + " -q --shard-size 100k --key S1_D1_");
    }

    void put_pictures(const Path& base, const std::string& name, const DepthImages& images) const
    {
        for (const char* kind : {"depth", "label", "color", "visible"})
            fs::create_directories(base / kind);
        std::vector<uint16_t> depth;
        for (const float metres : images.depth)
            depth.push_back(uint16_t(std::lround(metres * 1000)));
        std::vector<uint8_t> visible;
        for (const float metres : images.depth)
            visible.push_back(metres > 0 ? 255 : 0);
        EXPECT_TRUE(write_png_gray16(base / "depth" / (name + ".png"), 96, 72, depth));
        EXPECT_TRUE(write_png_gray8(base / "label" / (name + ".png"), 96, 72, images.labels));
        EXPECT_TRUE(write_png_rgb8(base / "color" / (name + ".png"), 96, 72, images.colors));
        EXPECT_TRUE(write_png_gray8(base / "visible" / (name + ".png"), 96, 72, visible));
    }
    std::string at(std::string_view name) const { return (folder_ / name).string(); }

    ScratchFolder folder_;
};

TEST_F(Drive, is_packed_listed_verified_and_unpacked_to_the_same_bytes)
{
    const Json listed = json_of(run("dataset list --json " + at("set")).out);
    EXPECT_EQ(listed["moments"], 3);
    EXPECT_EQ(listed["pictures"], 24);
    EXPECT_EQ(listed["key_prefix"], "S1_D1_");
    EXPECT_EQ(listed["cameras"][1], (Json{{"name", "left"},
                                          {"first", 0},
                                          {"last", 2},
                                          {"kinds", {{"color", 3}, {"depth", 3}, {"label", 3}, {"visible", 3}}}}));
    EXPECT_EQ(listed["files"], Json{"transforms.json"});
    EXPECT_NE(run("dataset list " + at("set")).out.find("front            000000 to 000002  3 color"),
              std::string::npos);
    EXPECT_EQ(json_of(run("dataset verify --json " + at("set")).out)["faults"], Json::array());
    run("dataset unpack -q " + at("set") + " -o " + at("out"));
    EXPECT_TRUE(files_of(folder_ / "out") == files_of(folder_ / "in"));
    expect_error(semrover_program("dataset unpack -q " + at("set") + " -o " + at("out")), 2, "exists; -y");
    expect_error(semrover_program("dataset pack -q " + at("in") + " -o " + at("set")), 2, "exists; -y");
    EXPECT_EQ(json_of(run("dataset pack -y --json " + at("in") + " -o " + at("set")).out)["shards"], 1);
    expect_error(semrover_program("dataset list " + at("in")), 3, "index.json");
}

TEST_F(Drive, verify_names_what_is_wrong)
{
    const Path file = folder_ / "set/frames-00000.tar";
    std::string bytes = contents(file);
    ++bytes[600]; // of front/color/000000.png, which lies at byte 512
    folder_.put("set/frames-00000.tar", bytes);
    const ProgramResult result = semrover_program("dataset verify " + at("set"));
    EXPECT_EQ(result.code, 3);
    EXPECT_EQ(result.out, "front/color/000000.png: its bytes in frames-00000.tar have another hash\n");
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    expect_error(semrover_program("dataset unpack -q " + at("set") + " -o " + at("out")), 3, "front/color/000000.png");
    EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(Drive, is_refined_from_a_set_as_from_its_folder)
{
    put_renderer_model(folder_ / "model");
    const auto refine = [&](std::string_view input, std::string_view output, const std::string& more = "") {
        run(fmt::format("refine {} -m {} -o {} -q --steps 2 {}", at(input), at("model"), at(output), more));
        std::map<std::string, std::string> files = files_of(folder_ / output);
        files.erase("run.json"); // has seconds
        return files;
    };
    const auto folder = refine("in", "a"), set = refine("set", "b");
    EXPECT_TRUE(folder.contains("frames/left/000002.png"));
    EXPECT_TRUE(folder.contains("transforms.json"));
    EXPECT_TRUE(folder == set);
    const std::string before = contents(folder_ / "a/run.json");
    EXPECT_TRUE(refine("set", "a") == folder);
    EXPECT_EQ(contents(folder_ / "a/run.json"), before); // nothing to do: the inputs are the same
    // a camera alone, and frames that go on from a run that is a set, too
    EXPECT_EQ(refine("in/left", "c").at("frames/000001.png"), refine("set/left", "d").at("frames/000001.png"));
    run("dataset pack -q " + at("a") + " -o " + at("refined"));
    EXPECT_TRUE(refine("in", "e", "--frames 2: --from " + at("a")) ==
                refine("set", "f", "--frames 2: --from " + at("refined")));
    expect_error(semrover_program("refine " + at("in") + " -q -y --steps 2 -m " + at("model") + " -o " + at("refined")),
                 2, "is a shard set, which is read only");
}

TEST_F(Drive, is_fused_and_measured_from_a_set_as_from_its_folder)
{
    for (const char* input : {"in", "set"})
        run(fmt::format("fuse {} -o {} -q --max-depth 10", at(input), at(std::string("fused-") + input)));
    auto folder = files_of(folder_ / "fused-in"), set = files_of(folder_ / "fused-set");
    EXPECT_EQ(folder.erase("run.json") + set.erase("run.json"), 2u); // has seconds
    EXPECT_TRUE(folder == set);
    EXPECT_TRUE(fs::exists(folder_ / "fused-in/mesh.glb"));
    const auto figures = [&](std::string text, std::string_view input) {
        for (size_t i; (i = text.find('@')) != std::string::npos;)
            text.replace(i, 1, at(input));
        return run(text).out;
    };
    for (const char* eval :
         {"eval frames --json -q @ @ --visible @ --labels @", "eval frames --json -q @/left/color @/front",
          "eval depth --json -q @ @", "eval depth --json -q @/left @/front", "eval labels --json -q @/left @/front",
          "eval flicker --json -q @ --depth @ --path @/transforms.json"})
        EXPECT_EQ(figures(eval, "in"), figures(eval, "set")) << eval;
}

TEST_F(Drive, is_shown_from_a_set_as_from_its_folder)
{
    ASSERT_TRUE(write_grid(folder_ / "street.sgrid", street()));
    std::string pages[2];
    for (const bool set : {false, true}) {
        const std::string input = at(set ? "set" : "in"), page = at("page.html");
        run(fmt::format("page -q -y -o {} --grid {} --frames color={}/front/color --frames label={}/front/label", page,
                        at("street.sgrid"), input, input));
        std::string& html = pages[set];
        html = contents(page);
        for (size_t i; (i = html.find(input + "/")) != std::string::npos;)
            html.replace(i, input.size() + 1, "");
    }
    EXPECT_TRUE(pages[0] == pages[1]);
    for (const char* input : {"in", "set"})
        run(fmt::format("convert {} {}/sparse/0 --images {}", at("in/transforms.json"),
                        at(std::string("colmap-") + input), at(input)));
    const auto colmap = files_of(folder_ / "colmap-in");
    EXPECT_TRUE(colmap.contains("images/front/front_000002.png"));
    EXPECT_TRUE(colmap == files_of(folder_ / "colmap-set"));
    std::string reports[2] = {run("inspect --json " + at("in")).out, run("inspect --json " + at("set")).out};
    for (std::string& report : reports)
        for (const std::string& input : {at("in"), at("set")})
            for (size_t i; (i = report.find(input)) != std::string::npos;)
                report.replace(i, input.size(), "");
    EXPECT_EQ(reports[0], reports[1]);
}

TEST_F(Drive, a_set_that_is_cut_is_refused_by_readers)
{
    fs::resize_file(folder_ / "set/frames-00000.tar", 1000);
    put_renderer_model(folder_ / "model");
    const std::string refine = "refine @ -q -m " + at("model") + " -o " + at("out");
    for (const std::string& command :
         {std::string("dataset verify @"), std::string("eval frames -q @ @"), "fuse @ -q -o " + at("fused"), refine}) {
        std::string text = command;
        for (size_t i; (i = text.find('@')) != std::string::npos;)
            text.replace(i, 1, at("set"));
        expect_error(semrover_program(text), 3, "frames-00000.tar' has 1000 bytes, its index says");
    }
}

} // namespace cli_dataset_test
} // namespace semrover
