// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/scene/tiles.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_edit_test {

const std::string kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
const std::string kSettings = " -m " + kModel + " --steps 2 --region-size 48 --coverage-threshold 12 --quiet ";
constexpr size_t kPerCell = 60;

// a road of 40 x 12 voxels with a facade; a car of 4 x 2 x 2 voxels whose lower half replaces road. Every voxel has
// points.
VoxelGrid street()
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = 20;
    for (int32_t i = 0; i < 40; ++i)
        for (int32_t j = 0; j < 12; ++j)
            for (int32_t k = 0; k < 4; ++k) {
                const bool car = i >= 8 && i < 12 && (j == 4 || j == 5) && k < 2;
                if (k > 0 && j != 11 && !car)
                    continue;
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(car ? 13 : k ? 2 : 0);
            }
    for (size_t v = 0; v < grid.cells.size() * kPerCell; ++v) {
        grid.points.push_back(float_to_half(float(v * 7 % 501) / 1000 - 0.25f));
        grid.colors.push_back(uint8_t(v * 13));
    }
    grid.generated.assign(grid.cells.size(), 1);
    return grid;
}

bool same_content(const VoxelGrid& a, size_t i, const VoxelGrid& b, size_t j)
{
    return a.labels[i] == b.labels[j] && a.generated[i] == b.generated[j] &&
           std::equal(&a.points[i * kPerCell], &a.points[i * kPerCell] + kPerCell, &b.points[j * kPerCell]) &&
           std::equal(&a.colors[i * kPerCell], &a.colors[i * kPerCell] + kPerCell, &b.colors[j * kPerCell]);
}

class CliEdit : public testing::Test {
  protected:
    CliEdit() { EXPECT_TRUE(write_grid(folder_ / "in.sgrid", street())); }

    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string line(const std::string& command, const std::string& more, std::string_view output) const
    {
        return command + " " + path("in.sgrid") + " -o " + path(output) + " " + more;
    }
    VoxelGrid grid(std::string_view name) const
    {
        const auto grid = read_grid(path(name));
        EXPECT_TRUE(grid) << grid.error().message;
        return grid ? *grid : VoxelGrid();
    }
    Json run(const std::string& command) const
    {
        const ProgramResult result = semrover_program(command + " --json");
        EXPECT_EQ(result.code, 0) << result.err;
        return result.code ? Json() : json_of(result.out);
    }
    void expect_refusal(const std::string& command, int code, std::string_view text) const
    {
        const size_t entries = folder_.entries();
        const ProgramResult result = semrover_program(command);
        EXPECT_EQ(result.code, code) << command << ": " << result.err;
        EXPECT_TRUE(result.err.starts_with("semrover: error: ")) << result.err;
        EXPECT_NE(result.err.find(text), std::string::npos) << "expected \"" << text << "\", found: " << result.err;
        EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
        EXPECT_EQ(folder_.entries(), entries) << command << ": something was left behind";
    }

    ScratchFolder folder_;
};

// distance in voxels to the nearest voxel of the car
double from_car(const Cell& cell)
{
    double best = 1e9;
    for (int32_t i = 8; i < 12; ++i)
        for (int32_t j = 4; j < 6; ++j)
            for (int32_t k = 0; k < 2; ++k)
                best = std::min(best, std::hypot(cell[0] - i, cell[1] - j, cell[2] - k));
    return best;
}

TEST_F(CliEdit, a_removed_car_changes_its_halo_and_not_a_byte_beyond)
{
    const Json report = run(line("edit", "--remove car" + kSettings, "out.sgrid"));
    const VoxelGrid before = street(), after = grid("out.sgrid");
    EXPECT_EQ(std::ranges::count(after.labels, 13), 0);
    EXPECT_EQ(std::ranges::count(after.generated, 0), 0);
    size_t near = 0;
    for (size_t c = 0; c < after.cells.size(); ++c) {
        const size_t was = *find_cell(before, after.cells[c]);
        const bool same = same_content(before, was, after, c);
        if (from_car(after.cells[c]) > 5.0001)
            EXPECT_TRUE(same) << "voxel " << c;
        else
            near += !same;
    }
    EXPECT_EQ(report["regenerated"], near);
    EXPECT_GT(near, 100u);
    EXPECT_EQ(report["changed"], 16);
    EXPECT_EQ(report["removed"], 8);
    EXPECT_EQ(after.labels[*find_cell(after, {9, 4, 0})], 0); // road where it stood
    EXPECT_EQ(report["outputs"][0]["planned_device_bytes"], report["outputs"][0]["peak_device_bytes"]);
    EXPECT_EQ(semrover_program("edit " + path("out.sgrid") + " --undo " + path("out.sgrid.undo") + " -o " +
                               path("back.sgrid"))
                  .code,
              0);
    EXPECT_EQ(contents(path("back.sgrid")), contents(path("in.sgrid")));
}

TEST_F(CliEdit, the_halo_is_as_wide_as_asked)
{
    EXPECT_EQ(run(line("edit", "--remove car --halo 0" + kSettings, "a.sgrid"))["regenerated"], 8); // road under it
    EXPECT_EQ(run(line("edit", "--remove car --halo 0.6" + kSettings, "b.sgrid"))["regenerated"], 20);
}

TEST_F(CliEdit, any_batch_gives_the_same_bytes_and_a_killed_run_goes_on_to_them)
{
    const std::string edit = "--remove car" + kSettings;
    run(line("edit", edit + "--batch 1", "a.sgrid"));
    run(line("edit", edit + "--batch 5", "b.sgrid"));
    const std::string whole = contents(path("a.sgrid"));
    EXPECT_EQ(whole, contents(path("b.sgrid")));
    EXPECT_EQ(contents(path("a.sgrid.undo")), contents(path("b.sgrid.undo")));
    for (const int64_t regions : {1, 3}) {
        ChildProgram child(line("edit", edit + "--batch 1 -y", "killed.sgrid"));
        while (std::ranges::count(contents(path("killed.sgrid.run/journal.jsonl")), '\n') < regions && child.running())
            usleep(500);
        child.stop(SIGKILL);
        run(line("edit", edit + "-y", "killed.sgrid"));
        EXPECT_EQ(whole, contents(path("killed.sgrid")));
    }
    expect_refusal(line("edit", edit, "killed.sgrid"), 2, "-y replaces it");
}

TEST_F(CliEdit, two_seeds_differ_inside_and_agree_outside)
{
    const std::string inpaint = line("inpaint", "--box 6,3,0:12,8,9 --seeds 1,2" + kSettings, "out.sgrid");
    const Json report = run(inpaint);
    EXPECT_FALSE(std::filesystem::exists(path("out.sgrid")));
    const VoxelGrid before = street(), one = grid("out-seed1.sgrid"), two = grid("out-seed2.sgrid");
    size_t inside = 0;
    for (size_t c = 0; c < before.cells.size(); ++c) {
        const Cell& cell = before.cells[c];
        const double x = (cell[0] + 0.5) * 0.6, y = (cell[1] + 0.5) * 0.6;
        if (x >= 6 && x <= 12 && y >= 3 && y <= 8) {
            ++inside;
            EXPECT_FALSE(same_content(before, c, one, c) || same_content(before, c, two, c) ||
                         same_content(one, c, two, c));
        } else {
            EXPECT_TRUE(same_content(before, c, one, c) && same_content(before, c, two, c)) << c;
        }
    }
    EXPECT_EQ(report["regenerated"], inside);
    EXPECT_EQ(report["outputs"].size(), 2u);
    run(line("inpaint", "--box 6,3,0:12,8,9 --seed 2" + kSettings, "alone.sgrid"));
    EXPECT_EQ(contents(path("alone.sgrid")), contents(path("out-seed2.sgrid")));
    // started again, what is there is not done again, and what is not is
    const auto time = std::filesystem::last_write_time(path("out-seed1.sgrid"));
    std::filesystem::remove(path("out-seed2.sgrid"));
    run(inpaint);
    EXPECT_EQ(std::filesystem::last_write_time(path("out-seed1.sgrid")), time);
    EXPECT_EQ(contents(path("alone.sgrid")), contents(path("out-seed2.sgrid")));
}

TEST_F(CliEdit, inpaint_takes_a_mask_a_class_an_object_or_a_sphere)
{
    VoxelGrid mask;
    mask.voxel_size = 0.6f;
    mask.cells = {{3, 3, 0}, {3, 4, 0}, {9, 4, 1}, {500, 0, 0}};
    mask.labels = {0, 0, 0, 0};
    ASSERT_TRUE(write_grid(folder_ / "mask.sgrid", mask));
    const auto count = [&](const std::string& what) {
        return run(line("inpaint", what + kSettings + "-y", "out.sgrid"))["regenerated"];
    };
    EXPECT_EQ(count("--mask " + path("mask.sgrid")), 3);
    EXPECT_EQ(count("--class car --mask " + path("mask.sgrid")), 1);
    EXPECT_EQ(count("--class car"), 16);
    EXPECT_EQ(count("--object 9,4,1"), 16);
    EXPECT_EQ(count("--sphere 0.3,0.3,0.3,0.6"), 3);
}

TEST_F(CliEdit, without_a_model_changed_cells_wait_for_generate)
{
    const Json report = run(line("edit", "--remove car", "bare.sgrid"));
    EXPECT_EQ(report["regenerated"], 0);
    const VoxelGrid bare = grid("bare.sgrid");
    EXPECT_EQ(std::ranges::count(bare.generated, 0), 8);
    const ProgramResult filled =
        semrover_program("generate " + path("bare.sgrid") + " -o " + path("full.sgrid") + kSettings);
    ASSERT_EQ(filled.code, 0) << filled.err;
    EXPECT_EQ(std::ranges::count(grid("full.sgrid").generated, 0), 0);
}

TEST_F(CliEdit, operations_come_in_the_order_given_from_line_and_script)
{
    run(line("edit", "--paint road --class car --remove road --box 4,2,0:8,4,1", "a.sgrid"));
    // painted first, so the car's voxels are road when road is removed
    EXPECT_EQ(std::ranges::count(grid("a.sgrid").labels, 13), 0);
    EXPECT_LT(grid("a.sgrid").cells.size(), street().cells.size());
    folder_.put("edits.json", R"([{"op": "paint", "label": "road", "class": "car"},
                                  {"op": "remove", "class": "road", "box": [4, 2, 0, 8, 4, 1]}])");
    run(line("edit", "--script " + path("edits.json"), "b.sgrid"));
    EXPECT_EQ(contents(path("a.sgrid")), contents(path("b.sgrid")));
    folder_.put("edits.json", R"([{"op": "remove", "class": "car"}, {"op": "remove", "class": "bicycle"}])");
    expect_refusal(line("edit", "--script " + path("edits.json"), "c.sgrid"), 3,
                   "operation 2 of 2: remove: no voxel of the grid is selected");
}

TEST_F(CliEdit, a_car_is_cut_out_and_set_elsewhere)
{
    const Json cut = run(line("edit", "--cut --object 9,4,1", "car.sgrid"));
    EXPECT_EQ(cut["cells"], 16);
    EXPECT_EQ(cut["origin"], "8,4,0");
    run(line("edit", "--insert " + path("car.sgrid") + " --at 18,0.3,0.7 --rotate 90 --points keep" + kSettings,
             "out.sgrid"));
    const VoxelGrid before = street(), after = grid("out.sgrid");
    EXPECT_EQ(std::ranges::count(after.labels, 13), 32);
    // turned a quarter: 2 x 4 voxels from (30, 0, 1) on, points turned with them
    const size_t was = *find_cell(before, {8, 4, 0}), is = *find_cell(after, {31, 0, 1});
    EXPECT_EQ(after.labels[is], 13);
    EXPECT_EQ(half_to_float(after.points[is * kPerCell]), -half_to_float(before.points[was * kPerCell + 1]));
    EXPECT_EQ(after.points[is * kPerCell + 1], before.points[was * kPerCell]);
    EXPECT_EQ(after.colors[is * kPerCell], before.colors[was * kPerCell]);
}

TEST_F(CliEdit, a_dry_run_writes_nothing)
{
    const size_t entries = folder_.entries();
    const Json report = run(line("edit", "--remove car --dry-run" + kSettings, "out.sgrid"));
    EXPECT_GT(report["regions"], 1);
    EXPECT_EQ(folder_.entries(), entries);
    EXPECT_EQ(run(line("inpaint", "--class car --seeds 1,2,3 --dry-run" + kSettings, "out.sgrid"))["seeds"], 3);
}

TEST_F(CliEdit, what_makes_no_sense_is_refused_in_one_line)
{
    const auto edit = [&](const std::string& more) { return line("edit", more, "out.sgrid"); };
    expect_refusal(edit(""), 2, "no operation given");
    expect_refusal("edit " + path("in.sgrid") + " --remove car", 2, "-o/--output is required");
    expect_refusal(edit("--remove cat"), 2, "unknown class 'cat'");
    expect_refusal(edit("--remove all"), 2, "say which voxels");
    expect_refusal(edit("--remove truck"), 3, "no voxel of the grid is selected (class truck)");
    expect_refusal(edit("--remove-object 1,1"), 2, "expected a voxel i,j,k, found '1,1'");
    expect_refusal(edit("--remove-object 1,1,9"), 3, "no voxel (1, 1, 9)");
    expect_refusal(edit("--box 0,0,0:1,1,1 --remove car"), 2, "comes after the operation");
    expect_refusal(edit("--remove all --box 0,0,0:1,1"), 2, "expected a box");
    expect_refusal(line("edit", "--remove car -y", "in.sgrid"), 2, "input and output are the same");
    expect_refusal(edit("--remove all --box 1,0,0:0,1,1"), 2, "ends before it begins");
    expect_refusal(edit("--remove all --box 0,0,0:nan,1,1"), 2, "absurd");
    expect_refusal(edit("--remove all --sphere 0,0,0,0"), 2, "radius above 0");
    expect_refusal(edit("--paint road --box 0,0,0:900,900,900 --fill"), 3, "too many to fill");
    expect_refusal(edit("--paint road --class car --fill"), 2, "what is filled is a box");
    expect_refusal(edit("--copy --class car"), 2, "--by is missing");
    expect_refusal(edit("--insert " + path("in.sgrid")), 2, "--at is missing");
    expect_refusal(edit("--insert " + path("none.sgrid") + " --at 0,0,0"), 3, "none.sgrid");
    expect_refusal(edit("--insert " + path("in.sgrid") + " --at 0,0,0 --rotate 30"), 2, "0, 90, 180 or 270");
    expect_refusal(edit("--copy --class car --by 1e7,0,0"), 3, "absurd");
    expect_refusal(edit("--remove car --halo 99 -m " + kModel), 2, "--halo");
    for (const char* option : {"--seeds 1,2", "--seed 1", "--dry-run", "--preset quality", "--steps 2", "--batch 3"})
        expect_refusal(edit(std::string("--remove car ") + option), 2, "requires --model");
    expect_refusal(edit("--remove car --seeds 1,1 -m " + kModel), 2, "given twice");
    expect_refusal(edit("--remove car -m " + path("none")), 3, "none");
    expect_refusal(edit("--remove all --box=-99,-99,-99:99,99,99"), 3, "leaves no voxel");
    expect_refusal(edit("--script " + path("none.json")), 2, "none.json");
    expect_refusal(edit("--cut --remove car"), 2, "stands alone");
    expect_refusal(edit("--undo " + path("in.sgrid")), 3, "not an undo record");
    expect_refusal(edit("--remove car --max-vram 600KiB" + kSettings), 5, "--max-vram");
    expect_refusal(line("inpaint", kSettings, "out.sgrid"), 2, "say which voxels");
    expect_refusal(line("inpaint", "--class car", "out.sgrid"), 2, "--model");
    expect_refusal(line("inpaint", "--class truck" + kSettings, "out.sgrid"), 3, "no voxel of");
    expect_refusal(line("inpaint", "--mask " + path("none.sgrid") + kSettings, "out.sgrid"), 3, "none.sgrid");
    folder_.put("out.sgrid.undo", "of another time");
    expect_refusal(edit("--remove car"), 2, "out.sgrid.undo' exists; -y replaces it");
}

TEST_F(CliEdit, a_grid_is_cut_into_tiles_and_joined_again)
{
    const Json cut = run(line("tile", "--tile-size 6", "tiles"));
    EXPECT_EQ(cut["tiles"], 8);
    ASSERT_EQ(semrover_program("tile " + path("tiles") + " --join -o " + path("joined.sgrid")).code, 0);
    EXPECT_EQ(contents(path("joined.sgrid")), contents(path("in.sgrid")));
    expect_refusal(line("tile", "", "tiles"), 2, "is not empty");
    expect_refusal(line("tile", "--tile-size 0", "more"), 2, "--tile-size");
    expect_refusal("tile " + path("in.sgrid") + " --join -o " + path("x.sgrid"), 3, "index.json");
}

} // namespace cli_edit_test
} // namespace semrover
