// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/scene/grid.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <random>

namespace semrover {
namespace cli_eval_points_test {

ProgramResult eval_points(const std::string& arguments)
{
    return semrover_program("eval points -q " + arguments);
}

// a road with markings; `gray` takes this much of the colour's contrast away
VoxelGrid road(uint32_t seed, double gray)
{
    std::mt19937 random(seed);
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 20;
    for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 4; ++j) {
            grid.cells.push_back({i, j, 0});
            grid.labels.push_back(j == 2 ? 19 : 0);
        }
    grid.generated.assign(grid.cells.size(), 1);
    for (size_t i = 0; i < grid.cells.size() * 20; ++i) {
        const float x = float(random() % 600) / 1000 - 0.3f, y = float(random() % 600) / 1000 - 0.3f;
        const bool marking = grid.labels[i / 20] == 19 && y > 0;
        for (const float v : {x, y, 0.f})
            grid.points.push_back(float_to_half(v));
        for (int c = 0; c < 3; ++c)
            grid.colors.push_back(uint8_t(128 + (marking ? 100 : -60) * (1 - gray)));
    }
    return grid;
}

struct Files {
    ScratchFolder folder;

    std::string put(const std::string& name, const VoxelGrid& grid) const
    {
        const Path path = folder / name;
        std::filesystem::create_directories(path.parent_path());
        EXPECT_TRUE(write_grid(path, grid));
        return path.string();
    }
    std::string operator/(std::string_view name) const { return (folder / name).string(); }
};

TEST(CliEvalPoints, a_pair_is_measured_by_class)
{
    const Files files;
    const std::string truth = files.put("truth.sgrid", road(1, 0)), gray = files.put("gray.sgrid", road(2, 0.5));
    const ProgramResult result = eval_points(gray + " " + truth + " --json");
    ASSERT_EQ(result.code, 0) << result.err;
    const Json report = json_of(result.out);
    EXPECT_EQ(report["metric"], "points");
    EXPECT_EQ(report["left_out"], 0);
    EXPECT_EQ(report["pairs"].size(), 1u);
    EXPECT_EQ(report["classes"].size(), 2u);
    const Json &lane = report["classes"]["road-lane"], &asphalt = report["classes"]["road"];
    EXPECT_EQ(lane["cells"], 8);
    EXPECT_EQ(report["all"]["points"], 640);
    EXPECT_NEAR(asphalt["color_error"].get<double>(), 30 / 255., 1e-9);
    EXPECT_NEAR(lane["sharpness"]["ratio"].get<double>(), 0.5, 0.1); // half the contrast, other points
    EXPECT_GT(lane["sharpness"]["truth"], 0.1);
    EXPECT_TRUE(asphalt["sharpness"]["ratio"].is_null()); // an even colour has no steps
    EXPECT_GT(lane["edges"]["generated"], 0.1);           // steps of 80 of 255
    EXPECT_NEAR(lane["chamfer"].get<double>(),
                (lane["to_truth"].get<double>() + lane["to_generated"].get<double>()) / 2, 1e-12);
    const ProgramResult table = eval_points(gray + " " + truth);
    ASSERT_EQ(table.code, 0) << table.err;
    EXPECT_TRUE(table.out.starts_with("1 pair, 32 voxels, 0 left out")) << table.out;
    EXPECT_NE(table.out.find("road-lane"), std::string::npos) << table.out;
    const Json strong = json_of(eval_points(gray + " " + truth + " --json --strong-step 0.4").out);
    EXPECT_EQ(strong["classes"]["road-lane"]["edges"]["generated"], 0);
    EXPECT_GT(strong["classes"]["road-lane"]["edges"]["truth"], 0.1); // of 160
}

TEST(CliEvalPoints, folders_and_lists_are_pooled)
{
    const Files files;
    const std::string a = files.put("made/a.sgrid", road(2, 0.5)), b = files.put("made/b.sgrid", road(3, 0));
    const std::string ta = files.put("true/a.sgrid", road(1, 0)), tb = files.put("true/b.sgrid", road(3, 0));
    files.folder.put("made.txt", "made/b.sgrid\nmade/a.sgrid\n");
    files.folder.put("true.txt", "true/b.sgrid\ntrue/a.sgrid\n");
    const ProgramResult folders = eval_points((files / "made") + " " + (files / "true") + " --json");
    ASSERT_EQ(folders.code, 0) << folders.err;
    const Json report = json_of(folders.out);
    ASSERT_EQ(report["pairs"].size(), 2u);
    EXPECT_EQ(report["pairs"][1]["generated"], b);
    EXPECT_EQ(report["pairs"][1]["all"]["color_error"], 0);
    EXPECT_EQ(report["pairs"][1]["all"]["sharpness"]["ratio"], 1);
    EXPECT_EQ(report["all"]["cells"], 64);
    EXPECT_NEAR(report["all"]["chamfer"].get<double>(), report["pairs"][0]["all"]["chamfer"].get<double>() / 2, 1e-9);
    const Json listed = json_of(eval_points((files / "made.txt") + " " + (files / "true.txt") + " --json").out);
    EXPECT_NEAR(listed["all"]["chamfer"].get<double>(), report["all"]["chamfer"].get<double>(), 1e-12);
    EXPECT_EQ(listed["pairs"][0]["generated"], b);
}

TEST(CliEvalPoints, what_cannot_be_compared_is_one_clear_line)
{
    const Files files;
    const std::string truth = files.put("truth.sgrid", road(1, 0));
    VoxelGrid grid = road(1, 0);
    const auto against_truth = [&](const VoxelGrid& made) {
        return eval_points(files.put("made.sgrid", made) + " " + truth);
    };
    grid.voxel_size = 0.7f;
    expect_error(against_truth(grid), 3, "truth.sgrid': expected one voxel size, found 0.7 m generated and 0.6 m");
    grid = road(1, 0);
    grid.labels[5] = 13;
    expect_error(against_truth(grid), 3, "found 1 voxels that differ: (1, 1, 0) is car generated, road in truth");
    grid = road(1, 0);
    grid.cells.back()[2] = 4;
    expect_error(against_truth(grid), 3, "expected the same voxels on both sides, found 32 generated and 32 true ones");
    grid = road(1, 0);
    grid.generated.assign(32, 0);
    expect_error(against_truth(grid), 3, "none of 32 voxels is generated on both sides");
    expect_error(eval_points(SEMROVER_SOURCE_DIR "/assets/scenes/street.semantic.sgrid " + truth), 3,
                 "the generated grid is a semantic grid without points");
    expect_error(eval_points((files / "none.sgrid") + " " + truth), 3, "none.sgrid': no such file or folder");
    files.folder.put("broken.sgrid", "no grid");
    expect_error(eval_points((files / "broken.sgrid") + " " + truth), 3, "broken.sgrid");
    files.put("folder/a.sgrid", road(1, 0));
    expect_error(eval_points((files / "folder") + " " + truth), 3,
                 "expected two .sgrid files, two folders or two lists, found a folder and a file");
    files.put("other/b.sgrid", road(1, 0));
    expect_error(eval_points((files / "folder") + " " + (files / "other")), 3,
                 "other/a.sgrid' is missing: expected grids of the same names");
    files.put("other/a.sgrid", road(1, 0));
    expect_error(eval_points((files / "folder") + " " + (files / "other")), 3, "folder/b.sgrid' is missing");
    files.folder.put("one.txt", "truth.sgrid\n");
    files.folder.put("two.txt", "truth.sgrid\nmade.sgrid\n");
    expect_error(eval_points((files / "one.txt") + " " + (files / "two.txt")), 3,
                 "expected lists of equal length, found 1 grids");
    std::filesystem::create_directory(files.folder / "empty");
    expect_error(eval_points((files / "empty") + " " + (files / "folder")), 3, "no .sgrid or .ply files in it");
    expect_error(eval_points(truth + " " + truth + " --radius 2"), 3, "expected a radius of at most 3 voxels");
    expect_error(eval_points(truth + " " + truth + " --radius 0"), 2, "--radius");
    expect_error(eval_points(truth), 2, "TRUTH is required");
    expect_error(eval_points(truth + " " + truth + " --device none"), 4, "none");
}

} // namespace cli_eval_points_test
} // namespace semrover
