// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/scene/grid.h"
#include "engine/scene/palette.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "tests/support/json_text.h"
#include "tests/support/png_file.h"
#include "tests/support/program.h"

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

TEST(CliVoxelize, label_textures_say_classes_in_every_kind_of_png)
{
    const ScratchFolder folder;
    folder.put("m.mtl", "newmtl x\nmap_Kd label.png\n");
    const std::string mesh = folder
                                 .put("m.obj", "mtllib m.mtl\nv 0 0 0\nv 6 0 0\nv 6 3 0\nv 0 3 0\nvt 0 0\nvt 1 0\nvt 1 "
                                               "1\nvt 0 1\nusemtl x\nf 1/1 2/2 3/3 4/4\n")
                                 .string();
    const auto labels = [&](const PngFile& png, const std::string& more = "") {
        folder.put("label.png", png.bytes());
        const std::string out = (folder / "m.sgrid").string();
        const ProgramResult made =
            semrover_program("voxelize " + mesh + " -y -q --labels texture -o " + out + " " + more);
        if (made.code != 0)
            return std::pair(made.err, made.err);
        const auto grid = read_grid(out);
        EXPECT_TRUE(grid) << grid.error().message;
        const auto name = [&](const Cell& cell) { return label_name(grid->labels[*find_cell(*grid, cell)]); };
        return std::pair(name({1, 2, 0}), name({8, 2, 0}));
    };
    const std::pair<std::string, std::string> expect{"building", "car"};
    using P = PngFile;
    EXPECT_EQ(labels({2, 1, 8, P::kGray, "\x02\x0d", ""}), expect);
    EXPECT_EQ(labels({2, 1, 16, P::kGray, std::string("\0\x02\0\x0d", 4), ""}), expect);
    EXPECT_EQ(labels({2, 1, 4, P::kGray, "\x2d", ""}), expect);
    EXPECT_EQ(labels({2, 1, 8, P::kGrayAlpha, "\x02\xff\x0d\xff", ""}), expect);
    EXPECT_EQ(labels({2, 1, 8, P::kPalette, "\x02\x0d", std::string(3 * 20, '\x55')}), expect); // whatever the colours
    // colours of classes, as before: also as those of a palette, whose indices are then any
    const std::string building = "\x46\x46\x46", car("\0\0\x8e", 3);
    EXPECT_EQ(labels({2, 1, 8, P::kRgb, building + car, ""}), expect);
    EXPECT_EQ(labels({2, 1, 8, P::kPalette, std::string("\x01\0", 2), car + building}), expect);
    EXPECT_EQ(labels({2, 1, 8, P::kGray, "\x46\x0d", ""}), expect);
    // other programs' numbers
    const P kitti{2, 1, 16, P::kGray, std::string("\0\x0b\0\x1a", 4), ""};
    EXPECT_NE(labels(kitti).first.find("pixels of label textures have no label"), std::string::npos);
    EXPECT_EQ(labels(kitti, "--map cityscapes"), expect);
    EXPECT_EQ(labels({2, 1, 8, P::kGray, "\x0b\x1a", ""}, "--map cityscapes"), expect);
}

TEST(CliVoxelize, a_mesh_in_map_coordinates_says_how_to_move_it_and_is_moved)
{
    const ScratchFolder folder;
    const std::string out = (folder / "m.sgrid").string();
    const std::string mesh = folder
                                 .put("m.obj", "v 500123.4 4649000.7 12\nv 500129.4 4649000.7 12\nv 500129.4 4649000.7 "
                                               "15\nv 500123.4 4649000.7 15\nusemtl wall\nf 1 2 3 4\n")
                                 .string();
    const ProgramResult far = semrover_program("voxelize " + mesh + " -o " + out);
    EXPECT_EQ(far.code, 3);
    EXPECT_NE(far.err.find("--origin=-500126,-4649001,-14 moves it to the origin"), std::string::npos) << far.err;
    EXPECT_NE(far.err.find("beyond 2^20 voxels of 0.6 m"), std::string::npos) << far.err;
    expect_error(semrover_program("voxelize " + mesh + " -q -o " + out + " --ply " + (folder / "m.ply").string()), 3,
                 "the 32-bit floats of --ply are too coarse");
    const std::string origin = " --origin=-500123.4,-4649000.4,-12";
    ASSERT_EQ(semrover_program("voxelize " + mesh + " -q -o " + out + origin).code, 0);
    const auto grid = read_grid(out);
    ASSERT_TRUE(grid);
    EXPECT_EQ(grid->cells.size(), 50u);
    EXPECT_EQ(grid->cells.front(), (Cell{0, 0, 0}));
    EXPECT_NEAR(half_to_float(grid->points[1]), 0, 1e-3); // 0.3 is the middle of a voxel
    const ProgramResult chamfer =
        semrover_program("eval chamfer " + mesh + " " + out + " --samples 5000 --json" + origin);
    ASSERT_EQ(chamfer.code, 0) << chamfer.err;
    EXPECT_LT(json_of(chamfer.out)["grids"][0]["points_to_surface"].get<double>(), 5e-4);
    expect_error(semrover_program("voxelize " + mesh + " -y -o " + out + " --origin 1,2"), 2,
                 "--origin takes X,Y,Z in metres");
}

TEST(CliVoxelize, transparent_and_untextured_parts_have_options)
{
    const ScratchFolder folder;
    const std::string mesh = scene(folder), out = (folder / "m.sgrid").string();
    folder.put("m.mtl", "newmtl Road.001\nmap_Kd C:\\maps\\road.png\nnewmtl glass\nd 0.2\n");
    expect_error(semrover_program("voxelize " + mesh + " -q -o " + out), 3, "--missing-textures white goes on without");
    const std::string line = "voxelize " + mesh + " -y --missing-textures white -o " + out;
    const ProgramResult clear = semrover_program(line); // glass needs no label
    ASSERT_EQ(clear.code, 0) << clear.err;
    EXPECT_NE(clear.err.find("transparent, and so no surface: 'glass' (8 m^2)"), std::string::npos) << clear.err;
    EXPECT_EQ(read_grid(out)->colors[0], 255);
    const ProgramResult opaque = semrover_program(line + " --opaque --json --default-label wall");
    ASSERT_EQ(opaque.code, 0) << opaque.err;
    EXPECT_NEAR(json_of(opaque.out)["area"].get<double>(), 24, 1e-4);
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
                 "either POINTS or --sweep");
}

// n x n points 0.1 m apart at a height
std::string cloud(const ScratchFolder& folder, const std::string& name, double z, int n, double x = 500000,
                  double y = 4000000)
{
    std::string text = fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n"
                                   "property double z\nend_header\nnan 0 0\n",
                                   n * n + 1);
    for (int i = 0; i < n * n; ++i)
        text += fmt::format("{:.3f} {:.3f} {}\n", x + 0.1 * (i % n), y + 0.1 * (i / n), z);
    return folder.put(name, text).string();
}

TEST(CliVoxelize, eval_chamfer_takes_clouds_of_points)
{
    const ScratchFolder folder;
    const std::string a = cloud(folder, "a.ply", 0, 20), b = cloud(folder, "b.ply", 0.3, 20);
    const ProgramResult result = semrover_program("eval chamfer " + a + " " + b + " --json");
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_NE(result.err.find("a.ply': 1 points are not finite and left out"), std::string::npos) << result.err;
    const Json c = json_of(result.out)["grids"][0];
    EXPECT_EQ(c["points"], 400);
    EXPECT_NEAR(c["chamfer"].get<double>(), 0.3, 1e-5);
    EXPECT_NEAR(c["squares"].get<double>(), 0.09 + 0.09, 1e-5); // PyTorch3D's
    // a cloud and a mesh: a plane 0.3 m below
    const std::string mesh = folder.put("m.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n").string();
    const std::string above = cloud(folder, "c.ply", 0.3, 20, 0, 0);
    const ProgramResult plane = semrover_program("eval chamfer -q " + mesh + " " + above + " --samples 1000 --json");
    ASSERT_EQ(plane.code, 0) << plane.err;
    EXPECT_NEAR(json_of(plane.out)["grids"][0]["points_to_surface"].get<double>(), 0.3, 1e-4);
    EXPECT_GT(json_of(plane.out)["grids"][0]["surface_to_points"], 0.3);
    EXPECT_NE(semrover_program("eval chamfer -q " + a).code, 0); // a cloud alone
    const ProgramResult table = semrover_program("eval chamfer -q " + a + " " + b);
    EXPECT_NE(table.out.find("PyTorch3D's chamfer_distance"), std::string::npos) << table.out;
}

} // namespace cli_voxelize_test
} // namespace semrover
