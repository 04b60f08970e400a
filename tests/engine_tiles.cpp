// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#include "engine/scene/tiles.h"
#include "runtime/base/dtype.h"
#include "runtime/base/json.h"
#include "tests/support/grid_case.h"
#include "tests/support/json_text.h"
#include "tests/support/says.h"
#include "tests/support/scratch_folder.h"

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

TEST(engine_tiles, a_window_touches_its_tiles_and_what_is_not_needed_may_be_broken)
{
    const ScratchFolder folder;
    const VoxelGrid grid = plain(-11, 10, true);
    ASSERT_TRUE(write_tiles(folder / "tiles", grid, 4));
    const auto tiles = TileFolder::open(folder / "tiles");
    ASSERT_TRUE(tiles);
    for (const auto& [tile, entry] : tiles->tiles())
        if (tile[0] < -1 || tile[0] > 0 || tile[1] < 0 || tile[1] > 1)
            folder.put("tiles/" + tile_name(tile), "broken");
    EXPECT_EQ(tiles->tiles_in({{-3, 1}, {2, 6}}), (std::vector<TileIndex>{{-1, 0}, {-1, 1}, {0, 0}, {0, 1}}));
    for (const TileIndex& tile : tiles->tiles_in({{-3, 1}, {2, 6}}))
        EXPECT_TRUE(tiles->read(tile));
    EXPECT_TRUE(tiles->tiles_in({{500, 500}, {600, 600}}).empty());
    EXPECT_TRUE(says(tiles->read_all(), "tile_"));
}

TEST(engine_tiles, an_index_names_tiles_by_their_keys)
{
    const ScratchFolder folder;
    const VoxelGrid grid = plain(0, 8, true);
    ASSERT_TRUE(write_tiles(folder / "tiles", grid, 4));
    const std::string key = "0123456789abcdef";
    std::filesystem::rename(folder / "tiles/tile_1_0.sgrid", folder / "tiles" / tile_name({1, 0}, key));
    std::map<TileIndex, TileEntry> entries;
    EXPECT_TRUE(says(TileFolder::open(folder / "tiles"), "'tile_1_0.sgrid', which is not there"));
    for (const auto& [index, tile] : cut_tiles(grid, 4))
        entries[index] = {tile.cells.size(), index == TileIndex{1, 0} ? key : ""};
    ASSERT_TRUE(write_tile_index(folder / "tiles", {0.6f, 4, 2, true, grid.metadata}, entries));
    const auto back = read_grid_or_tiles(folder / "tiles");
    ASSERT_TRUE(back) << back.error().message;
    expect_same(*back, grid);
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
    with([](Json& j) { j["voxel_size"] = 0.3; }, "voxels of 0.6 m, the index says 0.3 m");
    with([](Json& j) { j["points_per_voxel"] = 3; }, "2 points a voxel, the index says 3");
    with([](Json& j) { j["has_points"] = false; }, "2 points a voxel, the index says 0");
    with([](Json& j) { j["has_points"] = "yes"; }, "expected true or false");
    with([](Json& j) { j["metadata"] = 3; }, "metadata: expected an object");
    with([](Json& j) { j["metadata"]["name"] = 3; }, "'name': expected a string");
    with([](Json& j) { j["tiles"] = Json::array(); }, "an empty one");
    with([](Json& j) { j["tiles"][1] = {1}; }, "entry 1: expected [X, Y, voxels]");
    with([](Json& j) { j["tiles"][1] = j["tiles"][0]; }, "is given twice");
    with([](Json& j) { j["tiles"][1].push_back("../../../../etc/"); }, "a key of 16 hexadecimal digits");
    with([](Json& j) { j["tiles"][1].push_back(7); }, "a key of 16 hexadecimal digits");
    with([](Json& j) { j["tiles"][0][2] = 1; }, "voxels, the index says 1");
    with([](Json& j) { j["tiles"][0][0] = 1e9; }, "expected a whole number");
    with([](Json& j) { j["tiles"].push_back({9, 9, 4}); }, "names 'tile_9_9.sgrid', which is not there");
    folder.put("tiles/index.json", "{");
    EXPECT_TRUE(says(read_grid_or_tiles(tiles), "index.json"));
    std::filesystem::remove(tiles / "index.json");
    EXPECT_TRUE(says(TileFolder::open(tiles), "index.json"));
    folder.put("tiles/index.json", index);
    folder.put("tiles/tile_1_1.sgrid", contents(tiles / "tile_0_0.sgrid")); // overlapping voxels
    EXPECT_TRUE(says(read_grid_or_tiles(tiles), "which belongs to tile (0, 0)"));
    std::filesystem::remove(tiles / "tile_1_1.sgrid");
    EXPECT_TRUE(says(read_grid_or_tiles(tiles), "'tile_1_1.sgrid', which is not there"));
}

} // namespace engine_tiles_test
} // namespace semrover
