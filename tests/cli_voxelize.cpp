// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/grid.h"
#include "runtime/base/json.h"
#include "tests/json_text.h"
#include "tests/program.h"

#include <gtest/gtest.h>

namespace semrover {
namespace cli_voxelize_test {

// a road of 4 m by 4 m and a pane beside it
std::string scene(const ScratchFolder& folder)
{
    folder.put("m.mtl", "newmtl Road.001\nKd 0.5 0.5 0.5\nnewmtl glass\nKd 0 0 1\n");
    return folder
        .put("m.obj", "mtllib m.mtl\nv 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 4 4 2\nv 0 4 2\nusemtl Road.001\nf 1 2 3 4\n"
                      "usemtl glass\nf 4 3 5 6\n")
        .string();
}

TEST(CliVoxelize, a_mesh_becomes_a_grid_with_labels_and_colours)
{
    const ScratchFolder folder;
    const std::string mesh = scene(folder), out = (folder / "m.sgrid").string();
    expect_error(semrover_program("voxelize " + mesh + " -o " + out), 3,
                 "no class is known for 'glass' (2 faces, 8 m^2); --map gives classes to names");
    folder.put("map.json", R"({"gl*": "building"})");
    const std::string mapped = " --map " + (folder / "map.json").string();
    const ProgramResult made = semrover_program("voxelize " + mesh + " -o " + out + mapped +
                                                " --json --points 5 --ply " + (folder / "m.ply").string());
    ASSERT_EQ(made.code, 0) << made.err;
    const Json json = json_of(made.out);
    const auto grid = read_grid(out);
    ASSERT_TRUE(grid) << grid.error().message;
    EXPECT_EQ(json["cells"], grid->cells.size());
    EXPECT_EQ(json["points"], grid->cells.size() * 5);
    EXPECT_NEAR(json["area"].get<double>(), 24, 1e-4);
    EXPECT_EQ(json["labels"].size(), 2u);
    EXPECT_EQ(grid->labels[*find_cell(*grid, {0, 0, 0})], 0);
    EXPECT_EQ(grid->labels[*find_cell(*grid, {0, 6, 2})], 2);
    EXPECT_EQ(grid->colors[0], 128); // Kd 0.5 is what a picture shows
    EXPECT_TRUE(std::filesystem::exists(folder / "m.ply"));
    const std::string bytes = contents(out);
    expect_error(semrover_program("voxelize " + mesh + " -o " + out + mapped), 2, "exists; -y replaces it");
    ASSERT_EQ(semrover_program("voxelize " + mesh + " -o " + out + mapped + " -q -y --points 5").code, 0);
    EXPECT_EQ(contents(out), bytes);
}

TEST(CliVoxelize, canonical_placement_is_said_in_the_grid_and_needs_no_seed)
{
    const ScratchFolder folder;
    const std::string line = "voxelize " + scene(folder) + " -q --default-label building --placement ";
    const auto made = [&](const std::string& name, const std::string& more) {
        const std::string out = (folder / name).string();
        const ProgramResult result = semrover_program(line + more + " -o " + out);
        EXPECT_EQ(result.code, 0) << result.err;
        return *read_grid(out);
    };
    const VoxelGrid a = made("a.sgrid", "canonical --seed 1"), b = made("b.sgrid", "canonical --seed 2");
    EXPECT_EQ(a.points, b.points);
    EXPECT_EQ(a.metadata.at("placement"), "canonical");
    EXPECT_NE(made("c.sgrid", "shifted --seed 1").points, made("d.sgrid", "shifted --seed 2").points);
    EXPECT_EQ(semrover_program(line + "random -o " + (folder / "e.sgrid").string()).code, 2);
}

TEST(CliVoxelize, scale_axes_and_a_default_label_apply)
{
    const ScratchFolder folder;
    const std::string mesh = scene(folder), out = (folder / "m.sgrid").string();
    const ProgramResult made = semrover_program("voxelize " + mesh + " -o " + out +
                                                " --up y --scale 0.5 --default-label traffic_sign --voxel-size 0.5");
    ASSERT_EQ(made.code, 0) << made.err;
    EXPECT_NE(made.err.find("warning: labelled traffic sign: 'glass' (2 faces, 2 m^2)"), std::string::npos) << made.err;
    const auto grid = read_grid(out);
    ASSERT_TRUE(grid);
    EXPECT_EQ(grid->voxel_size, 0.5f);
    EXPECT_TRUE(find_cell(*grid, {0, -1, 3})); // y of the file is up, x runs to the right
    expect_error(semrover_program("voxelize " + mesh + " -o " + out + " -y --default-label grass"), 2,
                 "unknown class 'grass'");
    expect_error(semrover_program("voxelize " + (folder / "none.obj").string() + " -o " + out + " -y"), 3, "none.obj");
}

TEST(CliVoxelize, eval_chamfer_measures_a_grid_or_sweeps)
{
    const ScratchFolder folder;
    const std::string mesh = scene(folder), grid = (folder / "m.sgrid").string(), csv = (folder / "c.csv").string();
    ASSERT_EQ(semrover_program("voxelize " + mesh + " -q --default-label wall -o " + grid).code, 0);
    const ProgramResult one = semrover_program("eval chamfer " + mesh + " " + grid + " --samples 20000 --json");
    ASSERT_EQ(one.code, 0) << one.err;
    const Json measured = json_of(one.out)["grids"][0];
    EXPECT_EQ(measured["points"], 20);
    EXPECT_LT(measured["points_to_surface"].get<double>(), 2e-4);
    EXPECT_NEAR(measured["chamfer"].get<double>(),
                (measured["points_to_surface"].get<double>() + measured["surface_to_points"].get<double>()) / 2, 1e-12);
    const ProgramResult sweep =
        semrover_program("eval chamfer " + mesh + " --sweep 4..32 --samples 20000 --json -q --csv " + csv);
    ASSERT_EQ(sweep.code, 0) << sweep.err;
    const Json grids = json_of(sweep.out)["grids"];
    ASSERT_EQ(grids.size(), 5u); // 4, 8, 16, 20, 32
    for (size_t i = 1; i < grids.size(); ++i)
        EXPECT_LT(grids[i]["chamfer"], grids[i - 1]["chamfer"]);
    EXPECT_EQ(grids[3]["chamfer"], measured["chamfer"]);
    const std::string table = contents(csv);
    EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 6);
    expect_error(semrover_program("eval chamfer " + mesh + " --sweep 4-32"), 2, "expected FIRST..LAST");
    expect_error(semrover_program("eval chamfer " + mesh + " " + grid + " --sweep 4..32"), 2,
                 "either a GRID or --sweep");
}

} // namespace cli_voxelize_test
} // namespace semrover
