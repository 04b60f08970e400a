// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/path_windows.h"
#include "engine/scene/tile_cache.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "tests/grid_case.h"
#include "tests/json_text.h"
#include "tests/says.h"
#include "tests/scratch_folder.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

namespace semrover {
namespace engine_tiles_test {

VoxelGrid plain(int32_t low, int32_t high, bool points)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    grid.points_per_voxel = points ? 2 : 20;
    for (int32_t i = low; i < high; ++i)
        for (int32_t j = low; j < high; ++j)
            for (int32_t k = 0; k < 1 + (i * j % 7 == 0); ++k)
                grid.cells.push_back({i, j, k});
    for (size_t c = 0; c < grid.cells.size(); ++c)
        grid.labels.push_back(uint8_t(c % 20));
    if (points)
        for (size_t v = 0; v < grid.cells.size() * 6; ++v) {
            grid.points.push_back(float_to_half(float(v % 50) / 250));
            grid.colors.push_back(uint8_t(v));
        }
    if (points)
        grid.generated.assign(grid.cells.size(), 1);
    grid.metadata["name"] = "plain";
    return grid;
}

TEST(engine_tiles, a_scene_comes_back_from_its_tiles)
{
    for (const bool points : {false, true})
        for (const int32_t edge : {1, 7, 8, 64}) {
            const ScratchFolder folder;
            const VoxelGrid grid = plain(-11, 10, points);
            ASSERT_TRUE(write_tiles(folder / "tiles", grid, edge));
            EXPECT_TRUE(TileFolder::is_one(folder / "tiles"));
            const auto tiles = TileFolder::open(folder / "tiles");
            ASSERT_TRUE(tiles) << tiles.error().message;
            EXPECT_EQ(tiles->cell_count(), grid.cells.size());
            const auto back = read_grid_or_tiles(folder / "tiles");
            ASSERT_TRUE(back) << back.error().message;
            expect_same(*back, grid);
        }
}

TEST(engine_tiles, negative_cells_belong_to_the_tile_below)
{
    EXPECT_EQ(tile_of({-1, 0, 5}, 8), (TileIndex{-1, 0}));
    EXPECT_EQ(tile_of({-8, 7, 5}, 8), (TileIndex{-1, 0}));
    EXPECT_EQ(tile_of({-9, 8, 5}, 8), (TileIndex{-2, 1}));
    EXPECT_EQ(tile_name({-2, 1}), "tile_-2_1.sgrid");
    EXPECT_EQ(*tile_cells_of(38.4, 0.6f), 64);
    EXPECT_TRUE(says(tile_cells_of(0.1, 0.6f), "expected 1 to"));
    EXPECT_TRUE(says(tile_cells_of(1e9, 0.6f), "expected 1 to"));
}

TEST(engine_tiles, a_window_reads_its_cells_and_only_the_tiles_that_it_touches)
{
    const ScratchFolder folder;
    const VoxelGrid grid = plain(-11, 10, true);
    ASSERT_TRUE(write_tiles(folder / "tiles", grid, 4));
    const auto tiles = TileFolder::open(folder / "tiles");
    ASSERT_TRUE(tiles);
    // what is not needed may be broken
    for (const auto& [tile, cells] : tiles->tiles())
        if (tile[0] < -1 || tile[0] > 0 || tile[1] < 0 || tile[1] > 1)
            folder.put("tiles/" + tile_name(tile), "broken");
    const CellWindow window{{-3, 1}, {2, 6}};
    const auto part = tiles->read(window);
    ASSERT_TRUE(part) << part.error().message;
    std::vector<Cell> expected;
    for (const Cell& cell : grid.cells)
        if (cell[0] >= -3 && cell[0] <= 2 && cell[1] >= 1 && cell[1] <= 6)
            expected.push_back(cell);
    EXPECT_EQ(part->cells, expected);
    for (size_t c = 0; c < expected.size(); ++c) {
        const size_t at = *find_cell(grid, expected[c]);
        EXPECT_TRUE(std::equal(&grid.points[at * 6], &grid.points[at * 6] + 6, &part->points[c * 6]));
    }
    EXPECT_TRUE(tiles->read(CellWindow{{500, 500}, {600, 600}})->cells.empty());
    EXPECT_TRUE(says(tiles->read_all(), "tile_"));
}

TEST(engine_tiles, folders_that_are_not_sound_are_refused)
{
    const ScratchFolder folder;
    const Path tiles = folder / "tiles";
    ASSERT_TRUE(write_tiles(tiles, plain(0, 8, true), 4));
    const std::string index = contents(tiles / "index.json");
    const auto with = [&](const std::function<void(Json&)>& change, const char* message) {
        Json json = json_of(index);
        change(json);
        folder.put("tiles/index.json", json.dump());
        EXPECT_TRUE(says(read_grid_or_tiles(tiles), message));
        folder.put("tiles/index.json", index);
    };
    ASSERT_TRUE(read_grid_or_tiles(tiles));
    with([](Json& j) { j["format"] = "other"; }, "not an index of tiles");
    with([](Json& j) { j["version"] = 2; }, "not an index of tiles");
    with([](Json& j) { j = Json::array(); }, "not an index of tiles");
    with([](Json& j) { j.erase("tile_cells"); }, "tile_cells is missing");
    with([](Json& j) { j["tile_cells"] = 0; }, "expected a whole number from 1");
    with([](Json& j) { j["tile_cells"] = 1e30; }, "expected a whole number from 1");
    with([](Json& j) { j["tile_cells"] = 4.5; }, "expected a whole number");
    with([](Json& j) { j["tile_cells"] = 5; }, "belongs to tile");
    with([](Json& j) { j["voxel_size"] = -1; }, "voxel size of 0.001 to 1000");
    with([](Json& j) { j["voxel_size"] = 0.3; }, "cells of 0.6 m, the index says 0.3 m");
    with([](Json& j) { j["points_per_voxel"] = 3; }, "2 points a cell, the index says 3");
    with([](Json& j) { j["has_points"] = false; }, "2 points a cell, the index says 0");
    with([](Json& j) { j["has_points"] = "yes"; }, "expected true or false");
    with([](Json& j) { j["metadata"] = 3; }, "metadata: expected an object");
    with([](Json& j) { j["metadata"]["name"] = 3; }, "'name': expected a string");
    with([](Json& j) { j["tiles"] = Json::array(); }, "an empty one");
    with([](Json& j) { j["tiles"][1] = {1}; }, "entry 1: expected [X, Y, cells]");
    with([](Json& j) { j["tiles"][1] = j["tiles"][0]; }, "is given twice");
    with([](Json& j) { j["tiles"][0][2] = 1; }, "cells, the index says 1");
    with([](Json& j) { j["tiles"][0][0] = 1e9; }, "expected a whole number");
    with([](Json& j) { j["tiles"].push_back({9, 9, 4}); }, "names 'tile_9_9.sgrid', which is not there");
    folder.put("tiles/index.json", "{");
    EXPECT_TRUE(says(read_grid_or_tiles(tiles), "index.json"));
    std::filesystem::remove(tiles / "index.json");
    EXPECT_TRUE(says(TileFolder::open(tiles), "index.json"));
    folder.put("tiles/index.json", index);
    std::filesystem::copy_file(tiles / "tile_0_0.sgrid", tiles / "tile_1_1.sgrid",
                               std::filesystem::copy_options::overwrite_existing); // overlapping cells
    EXPECT_TRUE(says(read_grid_or_tiles(tiles), "which belongs to tile (0, 0)"));
    std::filesystem::remove(tiles / "tile_1_1.sgrid");
    EXPECT_TRUE(says(read_grid_or_tiles(tiles), "'tile_1_1.sgrid', which is not there"));
}

CameraPath path_of(const std::vector<std::array<double, 3>>& places)
{
    CameraPath path;
    for (const auto& p : places) {
        CameraFrame frame;
        frame.pose.world_to_camera = {1, 0, 0, -p[0], 0, 1, 0, -p[1], 0, 0, 1, -p[2], 0, 0, 0, 1};
        path.frames.push_back(frame);
    }
    return path;
}

TEST(engine_tiles, a_path_is_cut_into_windows_of_equal_length)
{
    const auto w = PathWindows::cut(path_of({{0, 0, 1}, {0, 0, 2}, {6, 0, 1}, {6, 4, 1}, {6, 4, 1}}), 4);
    ASSERT_TRUE(w);
    EXPECT_DOUBLE_EQ(w->length(), 10);
    ASSERT_EQ(w->count(), 3u);
    using Piece = std::vector<GroundPoint>;
    EXPECT_EQ(w->piece(0), (Piece{{0, 0}, {4, 0}}));
    EXPECT_EQ(w->piece(1), (Piece{{4, 0}, {6, 0}, {6, 2}}));
    EXPECT_EQ(w->piece(2), (Piece{{6, 2}, {6, 4}}));
    EXPECT_EQ(PathWindows::cut(path_of({{3, 1, 1}}), 4)->piece(0), (Piece{{3, 1}}));
    EXPECT_EQ(PathWindows::cut(path_of({{0, 0, 0}, {8, 0, 0}}), 4)->count(), 2u);
    EXPECT_TRUE(says(PathWindows::cut(path_of({{0, 0, 0}, {1e9, 0, 0}}), 1e-3), "at most"));
}

TEST(engine_tiles, what_grows_in_a_window_lies_within_the_horizon_of_it)
{
    const std::vector<GroundPoint> piece = {{-2, 0}, {1, 0}, {1, 3}};
    EXPECT_DOUBLE_EQ(distance_to(piece, {-5, 4}), 5);
    EXPECT_DOUBLE_EQ(distance_to(piece, {0, 1}), 1);
    EXPECT_DOUBLE_EQ(distance_to(piece, {1, 5}), 2);
    VoxelGrid grid = plain(-11, 10, true);
    for (size_t c = 0; c < grid.cells.size(); c += 3)
        grid.generated[c] = 0;
    std::vector<uint32_t> expected;
    const CellWindow around = window_around(piece, 2.5, 0.6f);
    for (uint32_t c = 0; c < grid.cells.size(); c += 3) {
        const GroundPoint p = {(grid.cells[c][0] + 0.5) * 0.6, (grid.cells[c][1] + 0.5) * 0.6};
        double nearest = 1e9; // of many places along the piece
        for (int i = 0; i <= 3000; ++i)
            nearest =
                std::min({nearest, std::hypot(p[0] - (-2 + i * 0.001), p[1]), std::hypot(p[0] - 1, p[1] - i * 0.001)});
        if (nearest <= 2.5) {
            expected.push_back(c);
            EXPECT_TRUE(around.holds(grid.cells[c]));
        }
    }
    EXPECT_EQ(cells_to_grow(grid, piece, 2.5), expected);
    EXPECT_GT(expected.size(), 20u);
}

TEST(engine_tiles, the_cache_holds_only_tiles_of_the_window_and_storing_twice_is_storing_once)
{
    const ScratchFolder folder;
    const VoxelGrid grid = plain(0, 32, false);
    ASSERT_TRUE(write_tiles(folder / "in", grid, 4));
    std::filesystem::create_directory(folder / "out");
    for (const Path& scaffold : {folder / "in"}) {
        const auto source = TileSource::open(scaffold, 4);
        ASSERT_TRUE(source);
        TileCache cache(*source, folder / "out", 2);
        const auto window = cache.window({{0, 0}, {5, 3}});
        ASSERT_TRUE(window) << window.error().message;
        EXPECT_EQ(window->points_per_voxel, 2);
        EXPECT_EQ(std::ranges::count(window->generated, 0), int64_t(window->cells.size()));
        GrownCells grown;
        grown.cells = {{1, 1, 0}, {5, 2, 0}};
        grown.points.assign(12, float_to_half(0.1f));
        grown.colors.assign(12, 77);
        ASSERT_TRUE(cache.store(grown));
        const std::string first = contents(folder / "out/tile_0_0.sgrid");
        ASSERT_FALSE(first.empty());
        ASSERT_TRUE(cache.window({{16, 16}, {17, 17}}));
        EXPECT_LE(cache.cells_in_memory(), 32u);
        ASSERT_TRUE(cache.bring(grown.cells));
        ASSERT_TRUE(cache.store(grown));
        EXPECT_EQ(contents(folder / "out/tile_0_0.sgrid"), first);
        const auto again = cache.window({{0, 0}, {5, 3}});
        ASSERT_TRUE(again);
        EXPECT_EQ(std::ranges::count(again->generated, 1), 2);
        grown.cells[0] = {1, 1, 9};
        EXPECT_TRUE(says(cache.store(grown), "is not in tile"));
        grown.cells[0] = {999, 1, 9};
        EXPECT_TRUE(says(cache.bring(grown.cells), "not in the scaffold"));
    }
}

} // namespace engine_tiles_test
} // namespace semrover
