// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
// an option that does nothing with its input is a usage error that names both; advice in messages can be followed
#include "tests/support/program.h"
#include "tests/support/zip_bytes.h"
#include "tools/dataset/scene_readers.h"

namespace semrover {
namespace cli_option_meaning_test {

const std::string kAssets = std::string(SEMROVER_SOURCE_DIR) + "/assets/";

class CliOptionMeaning : public testing::Test {
  protected:
    std::string path(std::string_view name) const { return (folder_ / name).string(); }

    // of two classes; finer than a cell: 0.2 m
    std::string vox() const
    {
        VoxelGrid grid;
        grid.voxel_size = 0.2f;
        for (int32_t i = 0; i < 6; ++i)
            for (int32_t j = 0; j < 3; ++j) {
                grid.cells.push_back({i, j, 0});
                grid.labels.push_back(i < 3 ? 0 : 13);
            }
        grid.cells.push_back({6, 0, 0});
        grid.labels.push_back(8);
        EXPECT_TRUE(write_vox(folder_ / "m.vox", grid));
        return path("m.vox");
    }

    ScratchFolder folder_;
};

TEST_F(CliOptionMeaning, a_grid_has_no_use_for_options_of_other_grids)
{
    const std::string line = "convert " + vox() + " " + path("o.sgrid") + " ";
    EXPECT_EQ(semrover_program(line + "--dry-run").code, 0);
    for (const char* option : {"--min-fill 0.99", "--points-per-voxel 7", "--splat-radius 3", "--mask mask_lidar",
                               "--labels-only", "--label car", "--seed 3", "--opacity 0.5", "--splat-labels"})
        expect_error(semrover_program(line + option), 2,
                     std::string(option).substr(0, std::string(option).find(' ')) + " has no meaning for ");
    for (const char* option :
         {"--calib x", "--sample x", "--dtype f16", "--asd-init", "--camera x", "--fov-x 60", "-W 5"})
        expect_error(semrover_program(line + option), 2, "has no meaning for a scene, which '");
    EXPECT_FALSE(std::filesystem::exists(path("o.sgrid")));
}

TEST_F(CliOptionMeaning, splats_are_read_as_they_are)
{
    const std::string ply = path("s.ply");
    const std::string truth = kAssets + "scenes/street.truth.sgrid ";
    ASSERT_EQ(semrover_program("convert " + truth + ply + " --to 3dgs --splat-radius 0.05").code, 0);
    for (const char* option : {"--origin 1,2,3", "--voxel-size 1", "--splat-radius 0.1", "--opacity 0.5", "--map x"})
        expect_error(semrover_program("convert " + ply + " " + path("o.ply") + " --to 3dgs " + option), 2,
                     "has no meaning for ");
}

// every option of an input for every format: refused with its name, or it changes what is read, or what is said of it
TEST_F(CliOptionMeaning, no_option_of_an_input_is_dropped_in_silence)
{
    const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
    const auto ply = [&](const char* name, const std::string& properties, const std::string& rows) {
        return folder_
            .put(name, "ply\nformat ascii 1.0\nelement vertex 2\n" + kXyz + properties + "end_header\n" + rows)
            .string();
    };
    VoxelGrid grid = read_grid(kAssets + "scenes/street.semantic.sgrid").value();
    for (Cell& cell : grid.cells)
        cell[0] -= 30;
    ASSERT_TRUE(write_grid(folder_ / "g.sgrid", grid));
    ASSERT_TRUE(write_grid_npz(folder_ / "g.npz", grid));
    const std::string numpy = SEMROVER_SOURCE_DIR "/tests/data/numpy/";
    const std::string splats = path("s.ply");
    ASSERT_EQ(semrover_program("convert " + kAssets + "scenes/street.truth.sgrid " + splats +
                               " --to 3dgs --splat-radius 0.05")
                  .code,
              0);
    // an input, and what it cannot do without
    const std::vector<std::pair<std::string, std::string>> inputs = {
        {path("g.sgrid"), ""},
        {path("g.npz"), ""},
        {folder_.put("a.npy", npy_bytes("|u1", "(3, 1, 2)", std::string("\x04\x11\x04\x11\x0b\x04", 6))).string(),
         "--map occ3d --file-voxel-size 0.2"},
        {numpy + "occ3d_nuscenes.npz", ""},
        {numpy + "occ3d_nuscenes.npz", "--voxel-size 0.4 --origin 0,0,0.2"},
        {vox(), ""},
        {vox(), "--file-voxel-size 0.2"},
        {ply("l.ply", "property int label\n", "0 0 0 2\n1 0 0 5\n"), ""},
        {ply("c.ply", "property int label\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n",
             "0 0 0 2 1 2 3\n1 0 0 5 4 5 6\n"),
         ""},
        {ply("n.ply", "", "0 0 0\n1 0 0\n"), "--label car"},
        {ply("o.ply", "property int ObjTag\n", "0 0 0 2\n1 0 0 5\n"), "--map carla"},
        {splats, ""}};
    const std::string map =
        folder_.put("map.json", R"({"0": "wall", "2": "wall", "4": "wall", "11": "wall"})").string();
    const std::string vox_map = folder_.put("vox.json", R"({"1": "wall"})").string();
    const std::vector<std::pair<std::string, std::string>> options = {
        {"--map", map},        {"--voxel-size", "1.2"},  {"--file-voxel-size", "0.3"}, {"--origin", "1.2,0,0"},
        {"--min-fill", "0.9"}, {"--mask", "mask_lidar"}, {"--label", "bus"},           {"--points-per-voxel", "7"},
        {"--labels-only", ""}, {"--nearest-color", ""}};
    const auto read = [&](const std::string& line) {
        ProgramResult r = semrover_program(line);
        if (r.code == 0)
            r.out = contents(path("o.sgrid"));
        return r;
    };
    for (const auto& [input, needed] : inputs)
        for (const auto& [option, given] : options) {
            const bool is_vox = input.ends_with(".vox");
            const std::string value = is_vox && option == "--map" ? vox_map : given;
            if (needed.find(option) != std::string::npos || (is_vox && option == "--nearest-color"))
                continue; // of all colours of this file a class is known
            const std::string line =
                "convert " + input + " " + path(input == splats ? "o.ply" : "o.sgrid") + " -y -q " + needed;
            const ProgramResult plain = input == splats ? semrover_program(line + " --to 3dgs") : read(line);
            ASSERT_EQ(plain.code, 0) << line << plain.err;
            const std::string with = line + " " + option + " " + value + (input == splats ? " --to 3dgs" : "");
            const ProgramResult r = input == splats ? semrover_program(with) : read(with);
            if (r.code == 0) {
                EXPECT_NE(r.out, plain.out) << "dropped in silence: " << with;
            } else {
                EXPECT_TRUE(r.err.find(option + " has no meaning for ") != std::string::npos || r.code == 3)
                    << with << ": " << r.err;
            }
        }
}

TEST_F(CliOptionMeaning, paths_and_our_grids_refuse_them_too)
{
    const std::string tum = kAssets + "scenes/street.tum ", grid = kAssets + "scenes/street.semantic.sgrid ";
    expect_error(semrover_program("convert " + tum + path("o.json") + " --min-fill 0.5"), 2,
                 "--min-fill has no meaning for a trajectory, which '");
    EXPECT_EQ(semrover_program("convert " + tum + path("o.json") + " --dry-run").code, 0);
    EXPECT_FALSE(std::filesystem::exists(path("o.json")));
    expect_error(semrover_program("inspect " + grid + "--nearest-color"), 2, "--nearest-color has no meaning for ");
    expect_error(semrover_program("render " + grid + "--map x --path " + tum + "-o " + path("r")), 2,
                 "--map has no meaning for ");
    expect_error(semrover_program("generate " + grid + "-m " + kAssets + "model -o " + path("g") + " --horizon 5"), 2,
                 "--horizon requires --along");
    expect_error(semrover_program("streets -o " + path("s") + " --clouds 0.5"), 2, "--clouds requires --images");
    expect_error(semrover_program("render " + grid + "--path " + tum + "-o " + path("r") + " --fps 5"), 2,
                 "--fps requires --video");
}

TEST_F(CliOptionMeaning, finer_voxels_become_cells_as_those_of_other_programs_do)
{
    const std::string line = "convert " + vox() + " " + path("o.sgrid") + " -y --file-voxel-size 0.2 --json";
    const auto cells = [&](const std::string& more) {
        const ProgramResult r = semrover_program(line + more);
        EXPECT_EQ(r.code, 0) << r.err;
        return read_grid(path("o.sgrid"));
    };
    const auto any = cells("");
    ASSERT_TRUE(any);
    EXPECT_EQ(any->cells, (std::vector<Cell>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
    EXPECT_EQ(any->labels, (std::vector<uint8_t>{0, 13, 8}));
    EXPECT_EQ(any->voxel_size, 0.6f);
    const auto filled = cells(" --min-fill 0.3"); // a layer of three fills a third, one voxel 1/27
    ASSERT_TRUE(filled);
    EXPECT_EQ(filled->cells.size(), 2u);
    const auto moved = cells(" --origin=-0.2,0,0");
    ASSERT_TRUE(moved);
    EXPECT_EQ(moved->cells, (std::vector<Cell>{{-1, 0, 0}, {0, 0, 0}, {1, 0, 0}}));
    EXPECT_EQ(moved->labels, (std::vector<uint8_t>{0, 0, 13})); // two columns of road, one of car
    expect_error(semrover_program(line + " --min-fill 0.9"), 3, "no cell of 0.6 m is filled to 0.9 of its volume");
    expect_error(semrover_program(line + " --voxel-size 0.5"), 3, "is not a whole number of voxels of 0.2 m");
}

TEST_F(CliOptionMeaning, the_nearest_colour_can_be_taken_by_every_command_that_advises_it)
{
    std::string bytes = contents(vox());
    const size_t palette = bytes.find("RGBA");
    ASSERT_NE(palette, std::string::npos);
    bytes[palette + 12] = char(127); // of class 0, as 128 64 128 was
    const std::string odd = folder_.put("odd.vox", bytes).string();
    const std::string tum = kAssets + "scenes/street.tum";
    for (const std::string& line : {"inspect " + odd, "convert " + odd + " " + path("o.sgrid"),
                                    "generate " + odd + " -m " + kAssets + "model --dry-run",
                                    "render " + odd + " --semantic --top -W 32 -H 32 -o " + path("r")}) {
        expect_error(semrover_program(line), 3, "--nearest-color takes the nearest class's");
        const ProgramResult taken = semrover_program(line + " --nearest-color");
        EXPECT_EQ(taken.code, 0) << line << taken.err;
    }
}

} // namespace cli_option_meaning_test
} // namespace semrover
