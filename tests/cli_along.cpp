// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: programs
#include "engine/scene/tiles.h"
#include "runtime/base/hash.h"
#include "runtime/base/json.h"
#include "tests/support/child_program.h"
#include "tests/support/json_text.h"
#include "tests/support/program.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_along_test {

const std::string kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
const std::string kSettings = " -m " + kModel + " --steps 1 --region-size 40 --coverage-threshold 12 --quiet ";

// a road of 16 voxels across, with a wall, along x
VoxelGrid road(int32_t cells)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = 0; i < cells; ++i)
        for (int32_t j = -8; j < 8; ++j)
            for (int32_t k = 0; k < (j == 7 ? 3 : 1); ++k) {
                grid.cells.push_back({i, j, k});
                grid.labels.push_back(j == 7 ? 2 : 0);
            }
    return grid;
}

class CliAlong : public testing::Test {
  protected:
    CliAlong()
    {
        EXPECT_TRUE(write_grid(folder_ / "road.sgrid", road(60)));
        EXPECT_TRUE(write_tiles(folder_ / "road", road(60), 10));
        folder_.put("path.tum", "0 2 0 1 0 0 0 1\n1 20 0 1 0 0 0 1\n2 26 1 1 0 0 0 1\n");
    }
    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string line(std::string_view output, const std::string& more = "", std::string_view input = "road") const
    {
        return fmt::format("generate {} --along {} --horizon 3.5 --tile-size 3.6 -o {} {}{}", path(input),
                           path("path.tum"), path(output), kSettings, more);
    }
    Json run(const std::string& command) const
    {
        const ProgramResult result = semrover_program(command + " --json");
        EXPECT_EQ(result.code, 0) << result.err;
        return result.code ? Json() : json_of(result.out);
    }
    // hashes of all files of a folder of tiles, by name
    std::map<std::string, std::string> bytes(std::string_view name) const
    {
        std::map<std::string, std::string> files;
        for (const auto& entry : std::filesystem::directory_iterator(folder_ / name))
            files[entry.path().filename().string()] = hash_text(*hash_file(entry.path()));
        return files;
    }
    size_t tiles_in(std::string_view output) const
    {
        std::error_code ignored;
        size_t tiles = 0;
        for (const auto& entry : std::filesystem::directory_iterator(folder_ / output, ignored))
            tiles += entry.path().extension() == ".sgrid";
        return tiles;
    }
    int stop_after(std::string_view output, size_t tiles, int signal) const
    {
        ChildProgram child(line(output, "--batch 1"));
        while (tiles_in(output) < tiles && child.running())
            usleep(500);
        return child.stop(signal);
    }

    ScratchFolder folder_;
};

// voxels of `part` that have the points of `whole`
size_t same_cells(const VoxelGrid& part, const VoxelGrid& whole)
{
    size_t same = 0;
    for (size_t c = 0; c < part.cells.size(); ++c) {
        const auto at = find_cell(whole, part.cells[c]);
        same += at && std::equal(&part.points[c * 60], &part.points[c * 60] + 60, &whole.points[*at * 60]) &&
                std::equal(&part.colors[c * 60], &part.colors[c * 60] + 60, &whole.colors[*at * 60]);
    }
    return same;
}

TEST_F(CliAlong, tiles_within_the_horizon_have_the_bytes_of_the_order_of_tiles)
{
    const Json report = run(line("out"));
    const auto grid = read_grid_or_tiles(folder_ / "out");
    ASSERT_TRUE(grid) << grid.error().message;
    EXPECT_EQ(std::ranges::count(grid->generated, 1), int64_t(grid->cells.size()));
    EXPECT_EQ(report["cells"], grid->cells.size());
    EXPECT_EQ(report["tiles"], json_of(contents(path("out/index.json")))["tiles"].size());
    EXPECT_EQ(report["tiles"], tiles_in("out"));
    EXPECT_LT(grid->cells.size(), road(60).cells.size());
    for (const Cell& cell : road(60).cells) { // whatever is within the horizon is there
        const double x = (cell[0] + 0.5) * 0.6, y = (cell[1] + 0.5) * 0.6;
        double nearest = 1e9;
        for (int i = 0; i <= 1000; ++i) {
            const double t = i / 1000.0;
            nearest = std::min({nearest, std::hypot(x - (2 + 18 * t), y), std::hypot(x - (20 + 6 * t), y - t)});
        }
        EXPECT_TRUE(nearest > 3.5 || find_cell(*grid, cell)) << x << ", " << y;
        EXPECT_TRUE(nearest < 3.5 + 2 * 5.1 || !find_cell(*grid, cell)) << x << ", " << y; // a tile, and what it sees
    }
    ASSERT_EQ(semrover_program("generate " + path("road.sgrid") + " --order tiles --tile-size 3.6 -o " +
                               path("whole.sgrid") + kSettings)
                  .code,
              0);
    const auto whole = read_grid(folder_ / "whole.sgrid");
    ASSERT_TRUE(whole);
    EXPECT_EQ(same_cells(*grid, *whole), grid->cells.size());
    EXPECT_EQ(semrover_program("inspect " + path("out")).code, 0);
}

TEST_F(CliAlong, batches_a_plain_grid_and_another_way_give_the_same_world)
{
    run(line("a", "--batch 1"));
    run(line("b", "--batch 4"));
    EXPECT_EQ(bytes("a"), bytes("b"));
    run(line("c", "", "road.sgrid"));
    const auto tiles = read_grid_or_tiles(folder_ / "a"), plain = read_grid_or_tiles(folder_ / "c");
    ASSERT_TRUE(tiles && plain);
    EXPECT_EQ(tiles->cells, plain->cells);
    EXPECT_EQ(same_cells(*tiles, *plain), tiles->cells.size());
    folder_.put("path.tum", "0 26 1 1 0 0 0 1\n1 20 0 1 0 0 0 1\n2 2 0 1 0 0 0 1\n");
    run(line("d"));
    EXPECT_EQ(bytes("a"), bytes("d"));
}

TEST_F(CliAlong, a_run_that_was_killed_goes_on_to_the_same_bytes)
{
    run(line("whole"));
    for (const size_t tiles : {0, 1, 6}) {
        const std::string output = fmt::format("killed{}", tiles);
        EXPECT_EQ(stop_after(output, tiles, SIGKILL), 128 + SIGKILL);
        EXPECT_FALSE(std::filesystem::exists(folder_ / output / "index.json"));
        run(line(output, "--batch 3"));
        EXPECT_EQ(bytes("whole"), bytes(output)) << tiles;
    }
    for (size_t tiles = 1; tiles < 12; tiles += 4)
        EXPECT_EQ(stop_after("often", tiles, SIGKILL), 128 + SIGKILL);
    run(line("often"));
    EXPECT_EQ(bytes("whole"), bytes("often"));
    EXPECT_EQ(stop_after("stopped", 3, SIGINT), 130);
    run(line("stopped"));
    EXPECT_EQ(bytes("whole"), bytes("stopped"));
}

TEST_F(CliAlong, a_tile_that_is_missing_or_damaged_is_made_again)
{
    run(line("whole"));
    ASSERT_EQ(stop_after("part", 15, SIGKILL), 128 + SIGKILL);
    const auto spoil = [&](std::string_view output, const std::string& name, bool damage) {
        std::filesystem::remove(folder_ / output / name);
        if (damage)
            folder_.put(std::string(output) + "/" + name, "damaged");
    };
    for (const char* output : {"part", "whole"}) { // one that goes on, one that is finished
        size_t number = 0;
        for (const auto& [name, hash] : bytes(output)) {
            if (number++ % 3 != 1) // wanted ones, and those beside them
                continue;
            for (const char* end : {"", ".run"}) {
                std::filesystem::remove_all(folder_ / (std::string("out") + end));
                std::filesystem::copy(folder_ / (std::string(output) + end), folder_ / (std::string("out") + end),
                                      std::filesystem::copy_options::recursive);
            }
            spoil("out", name, number % 2);
            run(line("out"));
            EXPECT_EQ(bytes("whole"), bytes("out")) << output << " " << name << " " << number % 2;
        }
    }
}

// killed, or the disk was full, between the index and the run's end
TEST_F(CliAlong, a_run_whose_index_is_written_goes_on)
{
    run(line("out"));
    const auto whole = bytes("out");
    Json summary = json_of(contents(path("out.run/run.json")));
    summary["state"] = "running";
    summary.erase("results");
    folder_.put("out.run/run.json", summary.dump());
    EXPECT_NE(semrover_program(line("out", "--seed 5")).err.find("holds a run with other settings"), std::string::npos);
    for (const char* again : {"", "-y"}) {
        folder_.put("out.run/run.json", summary.dump());
        run(line("out", again));
        EXPECT_EQ(bytes("out"), whole);
    }
}

TEST_F(CliAlong, memory_does_not_grow_with_the_length)
{
    ASSERT_TRUE(write_tiles(folder_ / "long", road(150), 10));
    const Json near = run(line("near"));
    folder_.put("path.tum", "0 2 0 1 0 0 0 1\n1 80 0 1 0 0 0 1\n");
    const Json far = run(line("far", "", "long"));
    EXPECT_GT(size_t(far["cells"]), 2 * size_t(near["cells"]));
    EXPECT_EQ(far["metres"], 78.0);
    EXPECT_EQ(near["planned_device_bytes"], far["planned_device_bytes"]);
    EXPECT_LE(near["peak_device_bytes"], near["planned_device_bytes"]);
    EXPECT_LE(far["peak_device_bytes"], far["planned_device_bytes"]);
    const Json dry = run(line("none", "--dry-run", "long"));
    EXPECT_EQ(dry["cells"], far["cells"]);
    EXPECT_EQ(dry["tiles"], far["tiles"]);
    EXPECT_EQ(dry["peak_device_bytes"], far["planned_device_bytes"]);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "none"));
}

TEST_F(CliAlong, what_makes_no_sense_is_refused)
{
    run(line("out"));
    const auto refused = [&](const std::string& command, int code, std::string_view text) {
        const size_t entries = folder_.entries();
        const ProgramResult result = semrover_program(command);
        EXPECT_EQ(result.code, code) << result.err;
        EXPECT_NE(result.err.find(text), std::string::npos) << "expected \"" << text << "\", found: " << result.err;
        EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
        EXPECT_EQ(folder_.entries(), entries) << command;
    };
    EXPECT_EQ(run(line("out")), json_of(contents(path("out.run/run.json")))["results"]); // done before
    refused(line("out", "--seed 5"), 2, "-y replaces it");
    refused(line("x", "--first-cell 3"), 2, "--first-cell");
    refused(line("x", "--strategy paper"), 2, "leaves voxels empty");
    refused(line("x", "--order scene"), 2, "--order");
    refused(line("x", "--horizon 0"), 2, "--horizon");
    refused(line("x", "--ply " + path("x.ply")), 2, "--ply");
    refused(line("x", "--max-vram 600KiB"), 5, "--max-vram");
    refused(line("x", "", "nowhere"), 3, "nowhere");
    refused(line("x", "", "."), 3, "index.json");
    refused(line("road.sgrid"), 3, "is a file");
    run(line("out", "--seed 5 -y"));
    EXPECT_EQ(json_of(contents(path("out/index.json")))["metadata"]["seed"], "5");
    EXPECT_EQ(json_of(contents(path("out/index.json")))["tiles"].size(), tiles_in("out"));
    std::filesystem::create_directory(folder_ / "full");
    folder_.put("full/mine.txt", "x");
    EXPECT_EQ(semrover_program(line("full")).code, 2);
    EXPECT_EQ(contents(path("full/mine.txt")), "x");
    folder_.put("path.tum", "0 900 900 1 0 0 0 1\n");
    EXPECT_EQ(semrover_program(line("far")).code, 3);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "far"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "far.run"));
    folder_.put("path.tum", "0 nan 0 1 0 0 0 1\n");
    refused(line("x"), 3, "path.tum");
}

} // namespace cli_along_test
} // namespace semrover
