// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/tiles.h"
#include "runtime/base/hash.h"
#include "runtime/base/json.h"
#include "runtime/base/safetensors.h"
#include "tests/child_program.h"
#include "tests/json_text.h"
#include "tests/program.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <gtest/gtest.h>

namespace semrover {
namespace cli_along_test {

const std::string kModel = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
const std::string kSettings = " -m " + kModel + " --steps 1 --region-size 40 --coverage-threshold 12 --quiet ";

// a road of 16 cells across, with a wall, along x
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
        folder_.put("path.tum", "0 2 0 1 0 0 0 1\n1 20 0 1 0 0 0 1\n2 32 1 1 0 0 0 1\n");
    }
    std::string path(std::string_view name) const { return (folder_ / name).string(); }
    std::string line(std::string_view output, const std::string& more = "", std::string_view input = "road") const
    {
        return fmt::format("generate {} --along {} --horizon 3.5 --window 4 -o {} {}{}", path(input), path("path.tum"),
                           path(output), kSettings, more);
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
    int64_t journal_lines(std::string_view output) const
    {
        return std::ranges::count(contents(path(std::string(output) + ".run/journal.jsonl")), '\n');
    }
    int stop_after(std::string_view output, int64_t windows, int signal) const
    {
        ChildProgram child(line(output, "--batch 1"));
        while (journal_lines(output) < windows && child.running())
            usleep(500);
        return child.stop(signal);
    }

    ScratchFolder folder_;
};

TEST_F(CliAlong, cells_within_the_horizon_are_generated_and_no_others)
{
    const Json report = run(line("out"));
    const auto grid = read_grid_or_tiles(folder_ / "out");
    ASSERT_TRUE(grid) << grid.error().message;
    size_t generated = 0;
    for (size_t c = 0; c < grid->cells.size(); ++c) {
        const double x = (grid->cells[c][0] + 0.5) * 0.6, y = (grid->cells[c][1] + 0.5) * 0.6;
        double nearest = 1e9;
        for (int i = 0; i <= 6000; ++i) {
            const double t = i / 6000.0;
            nearest = std::min({nearest, std::hypot(x - (2 + 18 * t), y), std::hypot(x - (20 + 12 * t), y - t)});
        }
        if (std::abs(nearest - 3.5) < 1e-4)
            continue;
        EXPECT_EQ(grid->generated[c] != 0, nearest < 3.5) << x << ", " << y;
        generated += grid->generated[c];
    }
    EXPECT_EQ(report["cells"], generated);
    EXPECT_GT(generated, 500u);
    EXPECT_EQ(report["windows"], 8);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out.run/windows"));
}

TEST_F(CliAlong, batches_tiles_and_a_plain_grid_give_the_same_world)
{
    run(line("a", "--batch 1"));
    run(line("b", "--batch 4"));
    EXPECT_EQ(bytes("a"), bytes("b"));
    run(line("c", "--tile-size 9.6", "road.sgrid"));
    const auto tiles = read_grid_or_tiles(folder_ / "a"), plain = read_grid_or_tiles(folder_ / "c");
    ASSERT_TRUE(tiles && plain);
    EXPECT_EQ(std::ranges::count(tiles->generated, 1), std::ranges::count(plain->generated, 1));
    size_t compared = 0;
    for (size_t c = 0; c < tiles->cells.size(); ++c) {
        const auto other = find_cell(*plain, tiles->cells[c]);
        if (!tiles->generated[c])
            continue;
        ASSERT_TRUE(other);
        EXPECT_TRUE(std::equal(&tiles->points[c * 60], &tiles->points[c * 60] + 60, &plain->points[*other * 60]));
        ++compared;
    }
    EXPECT_GT(compared, 500u);
}

TEST_F(CliAlong, a_run_that_was_killed_goes_on_to_the_same_bytes)
{
    run(line("whole"));
    for (const int64_t windows : {0, 1, 4}) {
        const std::string output = fmt::format("killed{}", windows);
        EXPECT_EQ(stop_after(output, windows, SIGKILL), 128 + SIGKILL);
        EXPECT_FALSE(std::filesystem::exists(folder_ / output / "index.json"));
        run(line(output, "--batch 3"));
        EXPECT_EQ(bytes("whole"), bytes(output)) << windows;
    }
    for (int64_t windows = 1; windows < 6; windows += 2)
        EXPECT_EQ(stop_after("often", windows, SIGKILL), 128 + SIGKILL);
    run(line("often"));
    EXPECT_EQ(bytes("whole"), bytes("often"));
    EXPECT_EQ(stop_after("stopped", 2, SIGINT), 130);
    run(line("stopped"));
    EXPECT_EQ(bytes("whole"), bytes("stopped"));
}

// cells with points, as a run keeps them for its tiles
struct Made {
    std::vector<Cell> cells;
    std::vector<uint16_t> points;
    std::vector<uint8_t> colors;

    void add(const Cell& cell, const uint16_t* p, const uint8_t* c)
    {
        if (std::ranges::find(cells, cell) != cells.end())
            return;
        cells.push_back(cell);
        points.insert(points.end(), p, p + 60);
        colors.insert(colors.end(), c, c + 60);
    }
    void add_tile(const Path& path)
    {
        const auto tile = read_grid(path);
        ASSERT_TRUE(tile) << tile.error().message;
        for (size_t c = 0; c < tile->cells.size(); ++c)
            if (tile->generated[c])
                add(tile->cells[c], &tile->points[c * 60], &tile->colors[c * 60]);
    }
    void add_piece(const Path& path)
    {
        const auto file = Safetensors::open(path);
        ASSERT_TRUE(file) << file.error().message;
        const auto from = [&](const char* name) { return file->bytes(**file->get(name)); };
        std::vector<Cell> all(from("cells").size() / sizeof(Cell));
        std::vector<uint16_t> p(from("points").size() / 2);
        std::memcpy(all.data(), from("cells").data(), from("cells").size());
        std::memcpy(p.data(), from("points").data(), from("points").size());
        for (size_t i = 0; i < all.size(); ++i)
            add(all[i], &p[i * 60], reinterpret_cast<const uint8_t*>(from("colors").data()) + i * 60);
    }
    void write(const Path& path) const
    {
        const TensorData tensors[] = {{"cells", DType::i32, {cells.size(), 3}, std::as_bytes(std::span(cells))},
                                      {"points", DType::f16, {points.size()}, std::as_bytes(std::span(points))},
                                      {"colors", DType::u8, {colors.size()}, std::as_bytes(std::span(colors))}};
        ASSERT_TRUE(write_safetensors(path, tensors));
    }
};

TEST_F(CliAlong, tiles_that_a_killed_run_had_no_time_to_write_are_written)
{
    run(line("whole"));
    ASSERT_EQ(stop_after("out", 3, SIGKILL), 128 + SIGKILL);
    std::string journal = contents(path("out.run/journal.jsonl"));
    journal = journal.substr(0, journal.rfind('\n') + 1); // the last line may be half written
    const size_t last = journal.rfind('\n', journal.size() - 2) + 1;
    Json entry = json_of(journal.substr(last));
    const Path piece = folder_ / fmt::format("out.run/windows/{:06}.safetensors", size_t(entry["window"]));
    // as if it had died between the journal and the tiles: what was made is in the piece alone
    Made made;
    if (std::filesystem::exists(piece)) // it did
        made.add_piece(piece);
    for (const auto& [name, hash] : bytes("out")) {
        if (!name.ends_with(".sgrid"))
            continue;
        made.add_tile(folder_ / "out" / name);
        std::filesystem::remove(folder_ / "out" / name);
    }
    made.write(piece);
    entry["xxh64"] = hash_text(*hash_file(piece));
    folder_.put("out.run/journal.jsonl", journal.substr(0, last) + entry.dump() + "\n");
    run(line("out"));
    EXPECT_EQ(bytes("whole"), bytes("out"));
}

TEST_F(CliAlong, a_damaged_piece_is_told_and_not_used)
{
    ASSERT_EQ(stop_after("out", 3, SIGKILL), 128 + SIGKILL);
    const int64_t lines = journal_lines("out");
    folder_.put(fmt::format("out.run/windows/{:06}.safetensors", lines - 1), "damaged");
    const ProgramResult result = semrover_program(line("out"));
    EXPECT_EQ(result.code, 3);
    EXPECT_NE(result.err.find("is damaged; -y starts over"), std::string::npos) << result.err;
}

TEST_F(CliAlong, memory_does_not_grow_with_the_length)
{
    ASSERT_TRUE(write_tiles(folder_ / "long", road(240), 10));
    const Json near = run(line("near"));
    folder_.put("path.tum", "0 2 0 1 0 0 0 1\n1 132 0 1 0 0 0 1\n");
    const Json far = run(line("far", "", "long"));
    EXPECT_GT(far["cells"], 4 * size_t(near["cells"]) - size_t(near["cells"]) / 2);
    EXPECT_EQ(near["planned_device_bytes"], far["planned_device_bytes"]);
    EXPECT_LE(near["peak_device_bytes"], near["planned_device_bytes"]);
    EXPECT_LE(far["peak_device_bytes"], far["planned_device_bytes"]);
    size_t most = 0;
    for (const Json& leg : far["legs"])
        most = std::max<size_t>(most, leg["cells_in_memory"]);
    EXPECT_LE(most, 6u * 10 * 30); // tiles of six columns: a window of 4 m, its horizon and what is known around
    const Json dry = run(line("none", "--dry-run", "long"));
    EXPECT_EQ(dry["cells"], far["cells"]);
    EXPECT_EQ(dry["regions"], far["regions"]);
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
    refused(line("x", "--horizon 0"), 2, "--horizon");
    refused(line("x", "--window=-1"), 2, "--window");
    refused(line("x", "--tile-size 0.1", "road.sgrid"), 3, "expected 1 to");
    refused(line("x", "--ply " + path("x.ply")), 2, "--ply");
    refused(line("x", "--max-vram 600KiB"), 5, "--max-vram");
    refused(line("x", "", "nowhere"), 3, "nowhere");
    refused(line("x", "", "."), 3, "index.json");
    refused(line("road.sgrid"), 3, "is a file");
    std::filesystem::create_directory(folder_ / "full");
    folder_.put("full/mine.txt", "x");
    EXPECT_EQ(semrover_program(line("full")).code, 2);
    EXPECT_EQ(contents(path("full/mine.txt")), "x");
    folder_.put("path.tum", "0 900 900 1 0 0 0 1\n");
    EXPECT_EQ(semrover_program(line("far")).code, 3);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "far"));
    folder_.put("path.tum", "0 nan 0 1 0 0 0 1\n");
    refused(line("x"), 3, "path.tum");
}

} // namespace cli_along_test
} // namespace semrover
