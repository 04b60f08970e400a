// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/format/image.h"
#include "engine/scene/grid.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"
#include "tests/support/zip_bytes.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_convert_scene_test {

const std::string kScenes = SEMROVER_SOURCE_DIR "/assets/scenes/";
const std::string kTruth = kScenes + "street.truth.sgrid", kSemantic = kScenes + "street.semantic.sgrid";
const std::string kNumpy = SEMROVER_SOURCE_DIR "/tests/data/numpy/";

std::string line(const std::string& in, const std::string& out, const std::string& more)
{
    return "convert " + in + " " + out + " " + more;
}

ProgramResult convert(const std::string& in, const std::string& out, const std::string& more = "")
{
    return semrover_program(line(in, out, more));
}

VoxelGrid grid_of(const std::filesystem::path& path)
{
    const auto grid = read_grid(path);
    EXPECT_TRUE(grid) << grid.error().message;
    return grid ? *grid : VoxelGrid();
}

TEST(CliConvertScene, a_grid_goes_through_every_format_and_back)
{
    const ScratchFolder folder;
    const VoxelGrid truth = grid_of(kTruth);
    for (const char* name : {"g.npz", "g.vox", "g.ply"}) {
        const std::string there = (folder / name).string(), back = (folder / "back.sgrid").string();
        ASSERT_EQ(convert(kTruth, there).code, 0) << name;
        const ProgramResult result = convert(there, back, "-y --json");
        ASSERT_EQ(result.code, 0) << result.err;
        const auto json = json_of(result.out);
        EXPECT_EQ(json["cells"], 3710);
        EXPECT_EQ(json["labels"]["road"], 416);
        EXPECT_EQ(json["dropped"], 0);
        const VoxelGrid grid = grid_of(back);
        EXPECT_EQ(grid.cells, truth.cells);
        EXPECT_EQ(grid.labels, truth.labels);
        EXPECT_EQ(grid.colors, name == std::string("g.vox") ? std::vector<uint8_t>() : truth.colors);
    }
}

TEST(CliConvertScene, semantickitti_is_written_as_a_pair)
{
    const ScratchFolder folder;
    VoxelGrid grid = grid_of(kSemantic);
    VoxelGrid low = grid; // what is below 4.2 m
    low.cells.clear();
    low.labels.clear();
    for (size_t i = 0; i < grid.cells.size(); ++i)
        if (grid.cells[i][2] < 7) {
            low.cells.push_back(grid.cells[i]);
            low.labels.push_back(grid.labels[i]);
        }
    ASSERT_TRUE(write_grid(folder / "low.sgrid", low));
    const std::string label = (folder / "0.label").string(), back = (folder / "back.sgrid").string();
    ASSERT_EQ(convert((folder / "low.sgrid").string(), label).code, 0);
    EXPECT_TRUE(std::filesystem::exists(folder / "0.bin"));
    std::filesystem::remove(label);
    expect_error(convert((folder / "low.sgrid").string(), label), 2, "0.bin' exists; -y replaces it");
    ASSERT_EQ(convert((folder / "low.sgrid").string(), label, "-y").code, 0);
    ASSERT_EQ(convert((folder / "0.bin").string(), back).code, 0);
    EXPECT_EQ(grid_of(back).cells, low.cells);
    EXPECT_EQ(grid_of(back).labels, low.labels);
    expect_error(convert(kSemantic, (folder / "1.label").string()), 3, "928 of 3710 cells are outside its box");
    EXPECT_FALSE(std::filesystem::exists(folder / "1.label"));
    EXPECT_FALSE(std::filesystem::exists(folder / "1.bin"));
}

TEST(CliConvertScene, occ3d_is_recognised_by_its_arrays)
{
    const ScratchFolder folder;
    const std::string out = (folder / "o.sgrid").string();
    for (const auto& [name, format, cells] : {std::tuple{"occ3d_nuscenes.npz", "occ3d-nuscenes", 107},
                                              {"occ3d_waymo.npz", "occ3d-waymo", 10},
                                              {"grid.npz", "npz", 2}}) {
        const ProgramResult result = convert(kNumpy + name, out, "-y -q --json");
        ASSERT_EQ(result.code, 0) << result.err;
        const auto json = json_of(result.out);
        EXPECT_EQ(json["from"], format);
        EXPECT_EQ(json["cells"], cells);
    }
    expect_error(convert(kNumpy + "bomb.npz", out, "-y"), 3, "cells: expected shape [V, 3], found [8]");
    expect_error(convert(kNumpy + "arrays.npz", out, "-y"), 3, "expected an array cells, semantics or voxel_label");
}

TEST(CliConvertScene, unknown_labels_are_listed_and_a_map_says_what_they_are)
{
    const ScratchFolder folder;
    const std::string ply = folder
                                .put("p.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                                              "property float y\nproperty float z\nproperty int class\nend_header\n"
                                              "0 0 0 24\n1 0 0 24\n2 0 0 7\n")
                                .string();
    const std::string out = (folder / "o.sgrid").string();
    expect_error(convert(ply, out), 3, "unknown labels: 24 (2 points); --map says what they are");
    EXPECT_FALSE(std::filesystem::exists(out));
    const std::string map = folder.put("map.json", R"({"24": "road-lane"})").string();
    ASSERT_EQ(convert(ply, out, "--map " + map + " --voxel-size 0.5 --origin 1,-0.5,0").code, 0);
    EXPECT_EQ(grid_of(out).labels, (std::vector<uint8_t>{19, 19, 7}));
    EXPECT_EQ(grid_of(out).cells, (std::vector<Cell>{{2, -1, 0}, {4, -1, 0}, {6, -1, 0}}));
    expect_error(convert(ply, out, "-y --origin 1,2"), 2, "--origin takes X,Y,Z");
    expect_error(convert(ply, out, "-y --label dog"), 2, "--label: unknown class 'dog'");
}

TEST(CliConvertScene, splats_of_every_format_draw_the_same_picture)
{
    constexpr size_t kCells = 1000;
    const ScratchFolder folder;
    const std::string path = folder.put("one.tum", "0 1 0 1.7 -0.5 0.5 -0.5 0.5\n").string();
    const auto picture = [&](const std::string& scene) {
        const std::string out = (folder / "frames").string();
        const ProgramResult result =
            semrover_program("render " + scene + " --path " + path + " -W 64 -H 48 -q -y -o " + out);
        EXPECT_EQ(result.code, 0) << result.err;
        return read_png_rgb8(folder / "frames/color/000000.png")->pixels;
    };
    VoxelGrid grid = grid_of(kTruth); // the first metres of it
    grid.cells.resize(kCells);
    grid.labels.resize(kCells);
    grid.generated.resize(kCells);
    grid.points.resize(kCells * 60);
    grid.colors.resize(kCells * 60);
    const std::string in = (folder / "in.sgrid").string();
    ASSERT_TRUE(write_grid(in, grid));
    const std::vector<uint8_t> expected = picture(in);
    EXPECT_GT(std::ranges::count_if(expected, [](uint8_t c) { return c > 40; }), 1000);
    for (const auto& [name, to, most] : {std::tuple{"a.ply", "--to 3dgs", 1},
                                         {"b.ply", "--to 2dgs --splat-labels", 1},
                                         {"c.ply", "--to inria62", 1},
                                         {"d.glb", "", 1},
                                         {"e.splat", "", 24}}) {
        const std::string there = (folder / name).string();
        const ProgramResult result = convert(in, there, std::string(to) + " --json");
        ASSERT_EQ(result.code, 0) << result.err;
        EXPECT_EQ(json_of(result.out)["splats"], 20 * kCells);
        const std::vector<uint8_t> found = picture(there);
        ASSERT_EQ(found.size(), expected.size());
        double squares = 0;
        for (size_t i = 0; i < found.size(); ++i)
            squares += (found[i] - expected[i]) * (found[i] - expected[i]);
        // .splat has a rotation of bytes
        EXPECT_LT(std::sqrt(squares / double(found.size())), most / 8.0) << name;
        // and on to another format, without a device
        EXPECT_EQ(convert(there, (folder / "x.splat").string(), "-y -q").code, 0);
        EXPECT_EQ(std::filesystem::file_size(folder / "x.splat"), 32u * 20 * kCells);
    }
    for (const char* name : {"c.spz", "c.sog", "c.ksplat"}) {
        expect_error(convert((folder / "b.ply").string(), (folder / name).string()), 3, "is neither read nor written");
        expect_error(convert(folder.put(name, "x").string(), (folder / "c.ply").string()), 3, "splat-transform");
    }
    expect_error(convert((folder / "b.ply").string(), (folder / "u.glb").string(), "--up y"), 2,
                 "--up is for splats as .ply or .splat");
    expect_error(convert((folder / "d.glb").string(), (folder / "g.sgrid").string()), 2, "write points-ply first");
    ASSERT_EQ(convert((folder / "b.ply").string(), (folder / "p.ply").string(), "-q --to points-ply").code, 0);
    ASSERT_EQ(convert((folder / "p.ply").string(), (folder / "g.sgrid").string(), "-q").code, 0);
    EXPECT_NEAR(double(grid_of(folder / "g.sgrid").cells.size()), double(kCells),
                200); // points on faces change their cell
}

TEST(CliConvertScene, inspect_and_render_read_what_convert_writes)
{
    const ScratchFolder folder;
    const std::string vox = (folder / "s.vox").string(), splats = (folder / "s.splat").string();
    ASSERT_EQ(convert(kSemantic, vox).code, 0);
    const ProgramResult grid = semrover_program("inspect --json " + vox);
    ASSERT_EQ(grid.code, 0) << grid.err;
    EXPECT_EQ(json_of(grid.out)["labels"]["vegetation"], 788);
    EXPECT_EQ(json_of(grid.out)["format"], "vox");
    ASSERT_EQ(convert(kSemantic, splats).code, 0); // the blocks of a grid without points
    const auto json = json_of(semrover_program("inspect --json " + splats).out);
    EXPECT_GT(json["count"], 100000);
    EXPECT_EQ(json["labelled"], 0);
    const auto top = [&](const std::string& scene) {
        const std::string out = folder.path().string();
        const ProgramResult result =
            semrover_program("render " + scene + " --semantic --top -W 40 -H 40 -qy -o " + out);
        EXPECT_EQ(result.code, 0) << result.err;
        return contents(folder / "top.png");
    };
    EXPECT_EQ(top(vox), top(kSemantic));
}

TEST(CliConvertScene, what_it_cannot_do_ends_with_one_line_and_a_code)
{
    const ScratchFolder folder;
    const std::string out = (folder / "o.sgrid").string();
    expect_error(convert((folder / "none.vox").string(), out), 3, "none.vox");
    expect_error(convert(folder.put("x.vox", "text").string(), out), 3, "no MagicaVoxel file");
    expect_error(convert(folder.put("x.ply", "text").string(), out), 3, "expected 'ply'");
    expect_error(convert(folder.put("x.npz", "text").string(), out), 3, "no .npz archive");
    expect_error(convert(folder.put("x.glb", "text").string(), out), 3, "no binary glTF file");
    expect_error(convert(folder.put("x.splat", "text").string(), out), 3, "expected splats of 32 bytes");
    expect_error(convert(folder.put("x.label", "text").string(), out), 3, "expected 4194304 bytes");
    expect_error(convert(folder.put("x.obj", "text").string(), out), 3, "no extension of a scene; formats are sgrid");
    expect_error(convert(kSemantic, (folder / "o.usd").string(), "--from sgrid"), 3, "no extension of a scene");
    expect_error(convert(kSemantic, out, "--to occ3d-waymo"), 2, "'occ3d-waymo' cannot be written");
    expect_error(convert(kSemantic, out, "--from tiff"), 2, "there is no format 'tiff'");
    expect_error(convert(kSemantic, out, "--splat-radius x"), 2, "--splat-radius takes metres");
    expect_error(convert(kSemantic, out, "--dtype f16"), 2, "--dtype has no meaning for a scene");
    expect_error(convert(kSemantic, kSemantic, "-y"), 2, "IN and OUT are the same");
    expect_error(convert(kSemantic, (folder / "no/o.vox").string()), 3, "cannot write");
    EXPECT_FALSE(std::filesystem::exists(out));
    ASSERT_EQ(convert(kSemantic, out, "--dry-run").code, 0);
    EXPECT_FALSE(std::filesystem::exists(out));
    EXPECT_EQ(semrover_program("inspect " + (folder / "x.vox").string()).code, 3);
    EXPECT_EQ(semrover_program("render " + (folder / "x.vox").string() + " --top -o " + (folder / "r").string()).code,
              3);
    EXPECT_FALSE(std::filesystem::exists(folder / "r"));
}

} // namespace cli_convert_scene_test
} // namespace semrover
