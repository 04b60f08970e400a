// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// worlds that are generated around a camera: the way there, budgets, caches and edits change no byte
#include "engine/world/world.h"

#include "runtime/base/hash.h"
#include "tests/json_text.h"
#include "tests/scratch_folder.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

namespace semrover {
namespace engine_job_world_test {

namespace fs = std::filesystem;

constexpr int32_t kEdge = 6; // voxels of a tile

Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

GenerationOptions options()
{
    GenerationOptions o;
    o.model = SEMROVER_SOURCE_DIR "/tests/golden/sampling_ddpm/model";
    o.steps = 2;
    o.region_size = 24;
    o.coverage_threshold = 8;
    o.strategy = RegionStrategy::rim;
    o.batch = 2;
    o.tile_size = kEdge * 0.6;
    return o;
}

// a road along x with a wall beside it and a hole in it
VoxelGrid street(int32_t begin = -12, int32_t end = 24)
{
    VoxelGrid grid;
    grid.voxel_size = 0.6f;
    for (int32_t i = begin; i < end; ++i)
        for (int32_t j = -6; j < 12; ++j)
            for (int32_t k = 0; k < (j == 9 ? 3 : 1); ++k)
                if (i != 3 || j != 4) {
                    grid.cells.push_back({i, j, k});
                    grid.labels.push_back(j == 9 ? 2 : 0);
                }
    sort_cells(grid);
    return grid;
}

// all tiles of a grid as one part: what worlds must give tile by tile
VoxelGrid generated(VoxelGrid grid, uint32_t batch = 2)
{
    GenerationOptions o = options();
    o.batch = batch;
    const GenerationSettings settings = *resolve_generation(o);
    GridFilling filling(device(), settings);
    EXPECT_TRUE(filling.cut(grid, settings.regions));
    EXPECT_TRUE(filling.load(0, {}));
    EXPECT_TRUE(filling.start(nullptr));
    EXPECT_TRUE(*filling.step(JobBudget::unlimited()));
    return grid;
}

const VoxelGrid& whole()
{
    static const VoxelGrid grid = generated(street());
    return grid;
}

std::unique_ptr<World> open(const Path& cache = {}, uint64_t host_bytes = 0, uint32_t at_once = 1,
                            VoxelGrid grid = street())
{
    WorldRequest r{.settings = *resolve_generation(options()), .store = cache};
    r.host_bytes = host_bytes;
    r.tiles_at_once = at_once;
    auto world = open_world(device(), std::move(r), labels_of_grid(std::move(grid)));
    EXPECT_TRUE(world) << world.error().message;
    return std::move(*world);
}

WorldFoci looking(double x, double radius, double direction = 1)
{
    return {{.position = {x, 1.5, 1.5}, .direction = {direction, 0, 0}, .radius = radius}};
}

size_t run(World& world, const JobBudget& budget = JobBudget::unlimited())
{
    size_t steps = 0;
    for (bool done = false; !done; ++steps) {
        const auto step = world.step(budget);
        EXPECT_TRUE(step) << step.error().message;
        done = !step || *step;
        EXPECT_LT(steps, 10000u);
    }
    return steps;
}

std::set<TileIndex> tiles_of(const World& world)
{
    std::set<TileIndex> tiles;
    for (int32_t x = -5; x < 8; ++x)
        for (int32_t y = -3; y < 4; ++y)
            if (world.tile({x, y}))
                tiles.insert({x, y});
    return tiles;
}

// of a tile's voxels, those with the same points as in `grid`
size_t same_cells(const VoxelGrid& tile, const VoxelGrid& grid)
{
    const size_t width = size_t(tile.points_per_voxel) * 3;
    size_t same = 0;
    for (size_t c = 0; c < tile.cells.size(); ++c) {
        const auto found = find_cell(grid, tile.cells[c]);
        same += found &&
                std::equal(&tile.points[c * width], &tile.points[c * width] + width, &grid.points[*found * width]) &&
                std::equal(&tile.colors[c * width], &tile.colors[c * width] + width, &grid.colors[*found * width]);
    }
    return same;
}

void expect_same(const World& world, const VoxelGrid& grid)
{
    EXPECT_FALSE(tiles_of(world).empty());
    for (const TileIndex& index : tiles_of(world)) {
        const VoxelGrid& tile = *world.tile(index);
        EXPECT_EQ(same_cells(tile, grid), tile.cells.size()) << index[0] << ", " << index[1];
        EXPECT_EQ(std::ranges::count(tile.generated, 1), int64_t(tile.cells.size()));
    }
}

// ---- the order of tiles

TEST(engine_job_world, every_batch_gives_the_same_bytes)
{
    for (const uint32_t batch : {1u, 5u}) {
        const VoxelGrid other = generated(street(), batch);
        EXPECT_EQ(other.points, whole().points);
        EXPECT_EQ(other.colors, whole().colors);
    }
    EXPECT_EQ(std::ranges::count(whole().generated, 1), int64_t(whole().cells.size()));
}

TEST(engine_job_world, a_part_with_the_neighbours_of_a_place_gives_the_bytes_of_the_whole)
{
    for (const int32_t tile : {0, 1}) {
        const VoxelGrid part = generated(street((tile - 1) * kEdge, (tile + 2) * kEdge));
        VoxelGrid place;
        place.points_per_voxel = part.points_per_voxel;
        for (size_t c = 0; c < part.cells.size(); ++c)
            if (tile_of(part.cells[c], kEdge)[0] == tile)
                append_cell(place, part, c);
        EXPECT_GT(place.cells.size(), 100u);
        EXPECT_EQ(same_cells(place, whole()), place.cells.size());
    }
}

// ---- worlds

TEST(engine_job_world, two_ways_to_a_place_give_the_same_bytes)
{
    const auto from_left = open(), from_right = open({}, 0, 4), at_once = open();
    for (double x = -6; x <= 4; x += 2) {
        ASSERT_TRUE(from_left->focus(looking(x, 2)));
        run(*from_left);
    }
    for (double x = 13; x >= 4; x -= 3) {
        ASSERT_TRUE(from_right->focus(looking(x, 2, -1)));
        run(*from_right);
    }
    ASSERT_TRUE(at_once->focus(looking(4, 30)));
    run(*at_once);
    for (const auto* world : {&from_left, &from_right, &at_once})
        expect_same(**world, whole());
    EXPECT_EQ(at_once->figures().generated, 18u); // all tiles of the street
    EXPECT_EQ(at_once->figures().finished, at_once->figures().wanted);
}

TEST(engine_job_world, a_submit_at_a_time_and_focus_between_them_change_nothing)
{
    const auto world = open();
    size_t steps = 0;
    for (double x = -6; steps < 60; x += 0.5, ++steps) {
        ASSERT_TRUE(world->focus(looking(x, 3)));
        ASSERT_TRUE(world->step(JobBudget::one_submit()));
    }
    ASSERT_TRUE(world->focus(looking(4, 4)));
    run(*world, JobBudget::one_submit());
    expect_same(*world, whole());
}

TEST(engine_job_world, what_is_ahead_comes_first)
{
    const auto order = [](double direction) {
        const auto world = open();
        EXPECT_TRUE(world->focus(looking(3, 12, direction)));
        std::vector<TileIndex> came;
        for (bool done = false; !done;) {
            done = *world->step(JobBudget::one_submit());
            for (const TileIndex& tile : world->tiles_with_points())
                if (std::ranges::find(came, tile) == came.end())
                    came.push_back(tile);
        }
        return came;
    };
    const std::vector<TileIndex> ahead = order(1), behind = order(-1);
    const auto rank = [](const std::vector<TileIndex>& came, const TileIndex& tile) {
        return std::ranges::find(came, tile) - came.begin();
    };
    EXPECT_LT(rank(ahead, {3, 0}), rank(ahead, {-2, 0}));
    EXPECT_GT(rank(behind, {3, 0}), rank(behind, {-2, 0}));
    EXPECT_LT(rank(ahead, {0, 0}), 9);
}

TEST(engine_job_world, what_was_dropped_comes_back_with_the_same_bytes_from_the_cache_or_anew)
{
    const ScratchFolder folder;
    for (const Path& cache : {Path(), folder / "cache"}) {
        const uint64_t budget = 34 << 10; // some four tiles
        const auto world = open(cache, budget);
        ASSERT_TRUE(world->focus(looking(-5, 1)));
        run(*world);
        const auto near = tiles_of(*world);
        EXPECT_LE(world->figures().host_bytes, budget);
        for (double x = -2; x < 14; x += 2) {
            ASSERT_TRUE(world->focus(looking(x, 1)));
            run(*world);
            EXPECT_LE(world->figures().host_bytes, budget);
            EXPECT_FALSE(world->figures().full);
        }
        EXPECT_GE(world->figures().dropped, 2u); // six tiles lie on the way
        EXPECT_FALSE(world->tile(*near.begin()));
        const uint64_t before = world->figures().generated;
        ASSERT_TRUE(world->focus(looking(-5, 1)));
        run(*world);
        EXPECT_TRUE(world->tile(*near.begin()));
        expect_same(*world, whole());
        EXPECT_EQ(world->figures().generated == before, !cache.empty());
        EXPECT_EQ(world->figures().loaded > 0, !cache.empty());
    }
}

// the file of a tile in a folder that an index names
std::string tile_file(const Path& folder, const TileIndex& tile)
{
    return tile_name(tile, TileFolder::open(folder)->tiles().at(tile).key);
}

TEST(engine_job_world, a_cache_serves_another_session_and_no_other_world)
{
    const ScratchFolder folder;
    const Path cache = folder / "cache";
    {
        const auto world = open(cache);
        ASSERT_TRUE(world->focus(looking(4, 30)));
        run(*world);
        ASSERT_TRUE(world->flush());
    }
    const auto again = open(cache);
    ASSERT_TRUE(again->focus(looking(4, 30)));
    run(*again);
    EXPECT_EQ(again->figures().generated, 0u);
    EXPECT_EQ(again->figures().loaded, 18u);
    expect_same(*again, whole());
    // one file is damaged, and one label is another: these tiles and those that see them are made anew
    folder.put("cache/" + tile_file(cache, {-2, -1}), "nothing");
    VoxelGrid other = street();
    other.labels[*find_cell(other, {8, 8, 0})] = 1; // of tile (1, 1), which nobody sees
    const auto changed = open(cache, 0, 1, other);
    ASSERT_TRUE(changed->focus(looking(4, 30)));
    run(*changed);
    EXPECT_EQ(changed->figures().generated, 2u);
    expect_same(*changed, generated(other));
}

TEST(engine_job_world, an_edit_spoils_its_tile_and_those_that_see_it_and_can_be_taken_back)
{
    const ScratchFolder folder;
    for (const Path& cache : {Path(), folder / "cache"}) {
        const auto world = open(cache);
        ASSERT_TRUE(world->focus(looking(4, 30)));
        run(*world);
        const std::vector<TileIndex> before = world->tiles_with_points();
        const Cell paved = {1, 2, 0}, gone = {2, 2, 0}, added = {1, 2, 1}; // of tile (0, 0)
        ASSERT_TRUE(world->edit({{paved, uint8_t(1)}, {gone, std::nullopt}, {added, uint8_t(13)}}));
        std::set<TileIndex> left(before.begin(), before.end());
        for (const TileIndex& tile : world->tiles_with_points())
            left.erase(tile);
        std::set<TileIndex> spoiled = {{0, 0}};
        for (const TileIndex& tile : tiles_that_see({0, 0}))
            spoiled.insert(tile);
        EXPECT_EQ(left, spoiled);
        EXPECT_FALSE(world->tile({0, 0}));
        expect_same(*world, whole()); // what is left of it
        run(*world);
        VoxelGrid other = street();
        other.labels[*find_cell(other, paved)] = 1;
        const size_t hole = *find_cell(other, gone);
        other.cells[hole] = added;
        other.labels[hole] = 13;
        sort_cells(other);
        const VoxelGrid expected = generated(other);
        expect_same(*world, expected);
        EXPECT_LT(same_cells(*world->tile({0, 0}), whole()), world->tile({0, 0})->cells.size());
        ASSERT_TRUE(world->edit({{paved, uint8_t(0)}, {gone, uint8_t(0)}, {added, std::nullopt}}));
        run(*world);
        expect_same(*world, whole());
        EXPECT_EQ(tiles_of(*world).size(), 18u);
    }
}

TEST(engine_job_world, an_edit_while_its_tile_is_made_begins_it_again)
{
    for (size_t steps = 1; steps < 14; steps += 3) {
        const auto world = open();
        ASSERT_TRUE(world->focus(looking(1, 0.5)));
        for (size_t i = 0; i < steps; ++i)
            ASSERT_TRUE(world->step(JobBudget::one_submit()));
        ASSERT_TRUE(world->edit({{{2, 2, 0}, uint8_t(1)}}));
        run(*world);
        VoxelGrid other = street();
        other.labels[*find_cell(other, {2, 2, 0})] = 1;
        static const VoxelGrid expected = generated(other);
        expect_same(*world, expected);
        EXPECT_TRUE(world->tile({0, 0}));
    }
}

TEST(engine_job_world, labels_come_from_a_folder_of_tiles_and_from_a_callback_alike)
{
    const ScratchFolder folder;
    ASSERT_TRUE(write_tiles(folder / "labels", street(), 16));
    WorldRequest r{.settings = *resolve_generation(options())};
    auto from_folder = open_world(device(), r, std::move(*labels_of_folder(folder / "labels")));
    const VoxelGrid all = street();
    size_t calls = 0;
    auto from_callback =
        open_world(device(), r, labels_of_callback(0.6f, [&](const CellWindow& window, VoxelGrid& grid) -> Status {
                       ++calls;
                       for (size_t c = all.cells.size(); c-- > 0;) // in any order
                           if (window.holds(all.cells[c]))
                               append_cell(grid, all, c);
                       return {};
                   }));
    ASSERT_TRUE(from_folder && from_callback);
    for (World* world : {from_folder->get(), from_callback->get()}) {
        ASSERT_TRUE(world->focus(looking(4, 6)));
        run(*world);
        expect_same(*world, whole());
    }
    EXPECT_GE(calls, (*from_callback)->figures().in_memory);
}

TEST(engine_job_world, an_error_of_the_source_is_told_and_the_next_step_tries_again)
{
    bool broken = true;
    const VoxelGrid all = street();
    auto world = open_world(device(), {.settings = *resolve_generation(options())},
                            labels_of_callback(0.6f, [&](const CellWindow& window, VoxelGrid& grid) -> Status {
                                if (broken)
                                    return fail(ErrorCode::bad_input, "no map here");
                                for (size_t c = 0; c < all.cells.size(); ++c)
                                    if (window.holds(all.cells[c]))
                                        append_cell(grid, all, c);
                                return {};
                            }));
    ASSERT_TRUE(world) << world.error().message;
    ASSERT_TRUE((*world)->focus(looking(4, 1)));
    const auto step = (*world)->step(JobBudget::unlimited());
    ASSERT_FALSE(step);
    EXPECT_EQ(step.error().message, "no map here");
    broken = false;
    run(**world);
    expect_same(**world, whole());
}

// ---- what is wanted

TEST(engine_job_world, a_focus_finds_its_tiles_nearest_first_and_counts_them_before)
{
    for (const double radius : {0., 1., 7.3, 40.})
        for (const double direction : {0., 1.}) {
            const WorldFocus focus{
                .position = {3.1, -7.9, 1}, .direction = {direction, -0.3 * direction, 0}, .radius = radius};
            TileOrder order({focus}, 3.6);
            const size_t size = order.size();
            std::set<TileIndex> expected, found;
            for (int32_t x = -15; x < 16; ++x)
                for (int32_t y = -15; y < 16; ++y)
                    if (distance_to_tile({3.1, -7.9}, {x, y}, 3.6) <= radius)
                        expected.insert({x, y});
            double last = 0;
            for (size_t rank = 0; const auto tile = order.at(rank); ++rank) {
                EXPECT_TRUE(found.insert(*tile).second);
                EXPECT_EQ(order.rank_of(*tile), rank);
                const double x = ((*tile)[0] + 0.5) * 3.6 - 3.1, y = ((*tile)[1] + 0.5) * 3.6 + 7.9;
                const double length = std::hypot(direction, 0.3 * direction);
                const double ahead = length > 0 ? (x - 0.3 * y) * direction / (std::hypot(x, y) * length) : 1;
                const double weight = std::hypot(x, y) * (2 - ahead);
                EXPECT_GE(weight, last - 1e-9) << rank;
                last = weight;
            }
            EXPECT_EQ(found, expected);
            EXPECT_EQ(size, expected.size());
            EXPECT_EQ(order.size(), expected.size());
        }
}

// brute force over all tiles; two disks that overlap, one within another, one far from all
TEST(engine_job_world, several_foci_find_the_tiles_of_each_once_nearest_to_any_first)
{
    const WorldFoci foci = {{.position = {3.1, -7.9, 1}, .direction = {1, -0.3, 0}, .radius = 12},
                            {.position = {13, -2, 0}, .direction = {0, 0, 0}, .radius = 9},
                            {.position = {4, -6, 0}, .direction = {0, 0, 0}, .radius = 2},
                            {.position = {-200, 40, 3}, .direction = {0, 2, 0}, .radius = 7.3}};
    std::map<TileIndex, double> expected; // with the weight of the nearest focus
    for (int32_t x = -70; x < 16; ++x)
        for (int32_t y = -15; y < 20; ++y)
            for (const WorldFocus& focus : foci) {
                const double px = focus.position[0], py = focus.position[1];
                const double left = x * 3.6, low = y * 3.6;
                const double dx = std::max({0., left - px, px - left - 3.6});
                const double dy = std::max({0., low - py, py - low - 3.6});
                if (std::hypot(dx, dy) > focus.radius)
                    continue;
                const double mx = left + 1.8 - px, my = low + 1.8 - py, away = std::hypot(mx, my);
                const double length = std::hypot(focus.direction[0], focus.direction[1]);
                const double ahead = (mx * focus.direction[0] + my * focus.direction[1]) / (away * length);
                const double weight = length > 0 ? away * (2 - ahead) : away;
                const auto [entry, added] = expected.emplace(TileIndex{x, y}, weight);
                entry->second = std::min(entry->second, weight);
            }
    TileOrder order(foci, 3.6);
    EXPECT_EQ(order.size(), expected.size());
    double last = 0;
    size_t count = 0;
    for (; const auto tile = order.at(count); ++count) {
        ASSERT_TRUE(expected.contains(*tile));
        EXPECT_EQ(order.rank_of(*tile), count);
        EXPECT_NEAR(expected.at(*tile), std::max(expected.at(*tile), last), 1e-9) << count;
        last = expected.at(*tile);
    }
    EXPECT_EQ(count, expected.size());
    EXPECT_EQ(order.size(), expected.size());
}

TEST(engine_job_world, tiles_along_a_track_are_those_within_the_horizon_in_the_order_of_the_way)
{
    const std::vector<GroundPoint> track = {{-10, 2}, {7, 2}, {12, 14}, {12, -9}};
    for (const double horizon : {0.2, 5.}) {
        const std::vector<TileIndex> tiles = tiles_along(track, horizon, 3.6);
        const std::set<TileIndex> found(tiles.begin(), tiles.end());
        EXPECT_EQ(found.size(), tiles.size());
        for (int32_t x = -10; x < 10; ++x)
            for (int32_t y = -10; y < 10; ++y) {
                double nearest = 1e9;
                for (size_t i = 0; i + 1 < track.size(); ++i)
                    for (double t = 0; t <= 1; t += 1. / 4096)
                        nearest =
                            std::min(nearest, distance_to_tile({track[i][0] + t * (track[i + 1][0] - track[i][0]),
                                                                track[i][1] + t * (track[i + 1][1] - track[i][1])},
                                                               {x, y}, 3.6));
                if (std::abs(nearest - horizon) > 0.01) {
                    EXPECT_EQ(found.contains({x, y}), nearest < horizon) << x << ", " << y;
                }
            }
        const auto rank = [&](const TileIndex& tile) { return std::ranges::find(tiles, tile) - tiles.begin(); };
        EXPECT_LT(rank({-3, 0}), rank({0, 0}));
        EXPECT_LT(rank({0, 0}), rank({3, 3}));
        EXPECT_LT(rank({3, 3}), rank({3, -2}));
    }
    EXPECT_EQ(tiles_along({{{1, 1}}}, 0.5, 3.6), (std::vector<TileIndex>{{0, 0}}));
}

TEST(engine_job_world, a_track_gives_the_bytes_of_everywhere_and_its_tiles_leave_memory)
{
    const ScratchFolder folder;
    const auto along = open(folder / "along"), everywhere = open(folder / "all");
    ASSERT_TRUE(along->follow({{{-5, 1.5}, {11, 1.5}}}, 1));
    size_t most = 0;
    for (bool done = false; !done;) {
        done = *along->step(JobBudget::one_submit());
        most = std::max(most, along->figures().in_memory);
    }
    EXPECT_LE(most, 9u);
    EXPECT_EQ(along->figures().finished, along->figures().wanted);
    EXPECT_EQ(along->figures().in_memory, 0u);
    ASSERT_TRUE(along->flush());
    ASSERT_TRUE(everywhere->everywhere());
    run(*everywhere);
    expect_same(*everywhere, whole());
    const VoxelGrid kept = *read_grid_or_tiles(folder / "along");
    EXPECT_EQ(same_cells(kept, whole()), kept.cells.size());
    for (int32_t x = -2; x < 4; ++x)
        EXPECT_TRUE(find_cell(kept, {x * kEdge, 2, 0}));
    EXPECT_FALSE(along->follow({{{0, 0}}}, 0));
}

// ---- points of the source

TEST(engine_job_world, points_that_the_source_has_stay_and_are_known_around)
{
    VoxelGrid half = whole();
    for (size_t c = 0; c < half.cells.size(); ++c)
        if (half.cells[c][0] % 5 > 1 || half.cells[c][0] < 0) {
            half.generated[c] = 0;
            std::fill_n(&half.points[c * 60], 60, uint16_t(0));
        }
    const VoxelGrid expected = generated(half);
    EXPECT_NE(expected.points, whole().points);
    const ScratchFolder folder;
    for (const int session : {0, 1}) {
        const auto world = open(folder / "store", 0, 1, half);
        ASSERT_TRUE(world->everywhere());
        run(*world);
        expect_same(*world, expected);
        EXPECT_EQ(world->figures().generated > 0, session == 0);
        ASSERT_TRUE(world->flush());
    }
    const VoxelGrid kept = *read_grid_or_tiles(folder / "store");
    EXPECT_EQ(kept.cells, expected.cells);
    EXPECT_EQ(kept.points, expected.points);
}

TEST(engine_job_world, worlds_of_two_seeds_share_a_store_and_the_last_one_is_named_by_the_index)
{
    const ScratchFolder folder;
    const auto session = [&](uint64_t seed) {
        WorldRequest r{.settings = *resolve_generation(options()), .seed = seed, .store = folder / "store"};
        auto world = *open_world(device(), std::move(r), labels_of_grid(street()));
        EXPECT_TRUE(world->focus(looking(4, 6)));
        run(*world);
        EXPECT_TRUE(world->flush());
        const VoxelGrid kept = *read_grid_or_tiles(folder / "store");
        EXPECT_EQ(same_cells(kept, whole()) == kept.cells.size(), seed == 0);
        return world->figures().generated;
    };
    EXPECT_GT(session(0), 0u);
    EXPECT_GT(session(5), 0u);
    EXPECT_EQ(session(0), 0u);
    EXPECT_EQ(session(5), 0u);
}

TEST(engine_job_world, a_store_that_cannot_be_written_is_read)
{
    const ScratchFolder folder;
    const Path store = folder / "store";
    const auto session = [&](double x) {
        const auto world = open(store);
        EXPECT_TRUE(world->focus(looking(x, 2)));
        run(*world);
        EXPECT_TRUE(world->flush());
        expect_same(*world, whole());
        return std::pair{world->figures().generated, world->figures().loaded};
    };
    EXPECT_GT(session(-4).first, 0u);
    fs::create_directory(store / "writable"); // where it tries to write
    const uint64_t before = *hash_folder(store);
    const auto [made, loaded] = session(-4);
    EXPECT_EQ(made, 0u);
    EXPECT_GT(loaded, 0u);
    EXPECT_GT(session(8).first, 0u);
    EXPECT_EQ(*hash_folder(store), before);
}

// ---- labels that come later

TEST(engine_job_world, tiles_whose_labels_are_not_there_yet_wait_and_no_others)
{
    const VoxelGrid all = street();
    bool late = true;
    size_t asked = 0;
    auto world = *open_world(device(), {.settings = *resolve_generation(options()), .tiles_at_once = 4},
                             labels_of_callback(0.6f, [&](const CellWindow& window, VoxelGrid& grid) -> Status {
                                 ++asked;
                                 if (late && window.holds({kEdge, 0, 0})) // of tile (1, 0), which two others see
                                     return fail(kNotYet, "later");
                                 for (size_t c = 0; c < all.cells.size(); ++c)
                                     if (window.holds(all.cells[c]))
                                         append_cell(grid, all, c);
                                 return {};
                             }));
    ASSERT_TRUE(world->focus(looking(4, 30)));
    run(*world);
    EXPECT_EQ(world->figures().generated, 18u - 1 - 2); // (1, -1) and (1, 1)
    EXPECT_FALSE(world->tile({1, 0}) || world->tile({1, 1}) || world->tile({1, -1}));
    EXPECT_EQ(world->figures().finished, world->figures().wanted - 3);
    expect_same(*world, whole());
    const size_t before = asked;
    run(*world);
    EXPECT_EQ(asked, before);
    late = false;
    world->labels_ready({{kEdge, 0}, {kEdge, 0}});
    run(*world);
    EXPECT_EQ(world->figures().generated, 18u);
    EXPECT_EQ(world->figures().finished, world->figures().wanted);
    expect_same(*world, whole());
}

// ---- what a frame costs

TEST(engine_job_world, a_wide_focus_over_nothing_looks_at_some_tiles_a_piece_and_keeps_none)
{
    size_t asked = 0;
    auto world = *open_world(device(), {.settings = *resolve_generation(options()), .host_bytes = 1},
                             labels_of_callback(0.6f, [&](const CellWindow&, VoxelGrid&) {
                                 ++asked;
                                 return Status();
                             }));
    ASSERT_TRUE(world->focus(looking(0, 100)));
    EXPECT_EQ(asked, 0u);
    const size_t wanted = world->figures().wanted;
    EXPECT_GT(wanted, 2000u);
    size_t steps = 0;
    for (bool done = false; !done; ++steps) {
        const size_t before = asked;
        done = *world->step({~0u, 0});
        EXPECT_LE(asked - before, 64u);
    }
    EXPECT_GT(steps, wanted / 64);
    EXPECT_EQ(asked, wanted);
    EXPECT_EQ(world->figures().finished, wanted);
    EXPECT_EQ(world->figures().host_bytes, 0u);
    EXPECT_EQ(world->figures().in_memory, 0u);
    EXPECT_FALSE(world->figures().full);
    ASSERT_TRUE(world->focus(looking(0.1, 100))); // an eighth of a tile is 0.45 m
    EXPECT_EQ(run(*world), 1u);
    EXPECT_EQ(asked, wanted);
}

// ---- splats

// how many splats a tile has, and the largest sigma
std::pair<size_t, float> splats_of(const World& world, const TileIndex& tile)
{
    const auto& places = world.splats()->places();
    const auto place = places.find(tile);
    if (place == places.end())
        return {};
    const Splats all = *world.splats()->scene().read();
    float largest = 0;
    for (size_t i = place->second.first; i < place->second.first + place->second.count; ++i) {
        EXPECT_GT(all.opacity[i], 0);
        largest = std::max(largest, all.sigma_u[i]);
    }
    return {place->second.count, largest};
}

// what the thread that draws does once a frame; false: nothing is new
bool show(World& world)
{
    const auto ring = *CommandRing::create(device(), 1);
    const uint64_t before = world.splats()->version();
    world.splats()->record_updates(*ring->begin(), device().next_point());
    EXPECT_TRUE(device().wait(*ring->submit()));
    return world.splats()->version() != before;
}

// tiles are 3.6 m wide and have some 36 voxels. The tiny model's points fill space, those of streets lie on surfaces
TEST(engine_job_world, far_tiles_have_fewer_and_larger_splats_and_all_of_them_when_they_are_near)
{
    WorldRequest r{.settings = *resolve_generation(options())};
    r.splat_bytes = 4u << 20;
    r.detail_distance = 2;
    const auto world = *open_world(device(), std::move(r), labels_of_grid(street()));
    ASSERT_TRUE(world->focus(looking(-3, 30)));
    run(*world);
    const TileIndex near{-1, 0}, half_cells{0, 0}, whole_cells{1, 0}, far{3, 0};
    const VoxelGrid& cells = *world->tile(far);
    const auto [all, small] = splats_of(*world, near);
    EXPECT_EQ(all, size_t(cells.points_per_voxel) * world->tile(near)->cells.size());
    const auto [some, larger] = splats_of(*world, half_cells);       // 3 m away
    const auto [fewer, larger_yet] = splats_of(*world, whole_cells); // 6.6 m
    const auto [few, large] = splats_of(*world, far);                // 13.8 m, two voxels
    EXPECT_LT(some, all * 7 / 10);
    EXPECT_LT(fewer, some / 2);
    EXPECT_LT(few, fewer / 2);
    EXPECT_GT(few, 0u);
    EXPECT_LT(small, larger);
    EXPECT_LT(larger, larger_yet);
    EXPECT_LT(larger_yet, large);

    EXPECT_TRUE(show(*world));
    ASSERT_TRUE(world->focus(looking(-3, 30)));
    run(*world);
    EXPECT_FALSE(show(*world)); // nothing is made again

    ASSERT_TRUE(world->focus(looking(12, 30)));
    run(*world);
    EXPECT_EQ(splats_of(*world, far).first, size_t(cells.points_per_voxel) * cells.cells.size());
    EXPECT_LT(splats_of(*world, near).first, all);
    ASSERT_TRUE(world->focus(looking(-3, 30)));
    run(*world);
    EXPECT_EQ(splats_of(*world, near), (std::pair{all, small}));
}

// of all points that the world has, in one scene, by where they are
std::multimap<std::array<float, 3>, std::pair<std::array<float, 3>, float>> normals_of_all(const World& world)
{
    ScenePoints all;
    for (const TileIndex& tile : tiles_of(world)) {
        const ScenePoints points = points_of(*world.tile(tile));
        all.positions.insert(all.positions.end(), points.positions.begin(), points.positions.end());
        all.colors.insert(all.colors.end(), points.colors.begin(), points.colors.end());
        all.labels.insert(all.labels.end(), points.labels.begin(), points.labels.end());
        all.cells.insert(all.cells.end(), points.cells.begin(), points.cells.end());
    }
    const Splats made = *SplatScene::create(device(), all, {.auto_sigma = true})->read();
    std::multimap<std::array<float, 3>, std::pair<std::array<float, 3>, float>> normals;
    for (size_t i = 0; i < made.position.size(); ++i)
        normals.emplace(made.position[i], std::pair(made.normal[i], made.sigma_u[i]));
    return normals;
}

void expect_normals_of_one_scene(World& world)
{
    const auto expected = normals_of_all(world);
    const Splats made = *world.splats()->scene().read();
    size_t count = 0;
    for (const auto& [tile, place] : world.splats()->places())
        for (size_t i = place.first; i < place.first + place.count; ++i, ++count) {
            const auto found = expected.find(made.position[i]);
            ASSERT_NE(found, expected.end());
            ASSERT_EQ(made.normal[i], found->second.first) << "tile " << tile[0] << ", " << tile[1];
            ASSERT_EQ(made.sigma_u[i], found->second.second);
        }
    EXPECT_EQ(count, expected.size());
}

TEST(engine_job_world, normals_at_borders_are_those_of_the_whole_street)
{
    WorldRequest r{.settings = *resolve_generation(options())};
    r.splat_bytes = 4u << 20;
    const auto world = *open_world(device(), std::move(r), labels_of_grid(street()));
    ASSERT_TRUE(world->focus(looking(4, 30)));
    run(*world);
    expect_normals_of_one_scene(*world);
    ASSERT_TRUE(world->edit({{{3, 0, 1}, uint8_t(2)}})); // also where a neighbour has other points now
    run(*world);
    expect_normals_of_one_scene(*world);
}

// a file that cannot be written stands for a full disk
TEST(engine_job_world, a_store_that_cannot_be_written_is_a_warning_and_no_splats_are_lost)
{
    const ScratchFolder folder;
    const Path store = folder / "cache";
    {
        const auto world = open(store);
        ASSERT_TRUE(world->focus(looking(4, 30)));
        run(*world);
        ASSERT_TRUE(world->flush());
    }
    const std::string file = tile_file(store, {0, 0});
    fs::remove_all(store);
    fs::create_directories(store / file / "in the way");
    WorldRequest r{.settings = *resolve_generation(options()), .store = store};
    r.splat_bytes = 4u << 20;
    r.tiles_at_once = 1;
    std::vector<std::string> warnings;
    const JobCallbacks callbacks{
        .progress = {}, .warning = [&](std::string_view text) { warnings.emplace_back(text); }, .detail = {}};
    const auto world = *open_world(device(), std::move(r), labels_of_grid(street()), callbacks);
    ASSERT_TRUE(world->focus(looking(4, 30)));
    run(*world, JobBudget::one_submit());
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find(file), std::string::npos) << warnings[0];
    EXPECT_EQ(world->figures().finished, world->figures().wanted);
    EXPECT_EQ(world->figures().generated, 18u);
    expect_same(*world, whole());
    for (const TileIndex& tile : tiles_of(*world)) {
        const VoxelGrid& cells = *world->tile(tile);
        EXPECT_EQ(splats_of(*world, tile).first, size_t(cells.points_per_voxel) * cells.cells.size());
    }
    EXPECT_FALSE(world->stored());
    EXPECT_FALSE(world->flush());
}

TEST(engine_job_world, splats_from_before_an_edit_stay_until_the_new_ones_are_there)
{
    WorldRequest r{.settings = *resolve_generation(options())};
    r.splat_bytes = 4u << 20;
    const auto world = *open_world(device(), std::move(r), labels_of_grid(street()));
    ASSERT_TRUE(world->focus(looking(4, 30)));
    run(*world);
    const auto tiles = tiles_of(*world);
    const size_t before = world->splats()->splats(), of_tile = splats_of(*world, {0, 0}).first;
    const Cell added = {1, 2, 1};
    LabelEdits edits = {{added, uint8_t(13)}};
    ASSERT_TRUE(world->edit(edits));
    EXPECT_FALSE(world->tile({0, 0}));
    EXPECT_EQ(world->splats()->splats(), before);
    for (bool done = false; !done;) {
        done = *world->step(JobBudget::one_submit());
        for (const TileIndex& tile : tiles)
            EXPECT_TRUE(world->splats()->has(tile));
    }
    EXPECT_EQ(splats_of(*world, {0, 0}).first, of_tile + size_t(world->tile({0, 0})->points_per_voxel));
    edits.clear();
    for (const Cell& cell : world->tile({3, 1})->cells) // nothing is left of this one
        edits[cell] = std::nullopt;
    ASSERT_TRUE(world->edit(edits));
    EXPECT_TRUE(world->splats()->has({3, 1}));
    run(*world);
    EXPECT_FALSE(world->splats()->has({3, 1}));
}

TEST(engine_job_world, without_a_model_a_world_shows_the_points_that_its_grid_has)
{
    VoxelGrid some = whole();
    const size_t without = *find_cell(some, {1, 2, 0});
    some.generated[without] = 0;
    WorldRequest r;
    r.settings.regions.tile_cells = kEdge;
    r.splat_bytes = 4u << 20;
    const auto world = *open_world(device(), std::move(r), labels_of_grid(some));
    ASSERT_TRUE(world->focus(looking(4, 30)));
    run(*world);
    EXPECT_EQ(world->figures().generated, 0u);
    expect_same(*world, whole());
    EXPECT_FALSE(find_cell(*world->tile({0, 0}), {1, 2, 0}));
    EXPECT_EQ(world->splats()->splats(), (some.cells.size() - 1) * size_t(some.points_per_voxel));
    ASSERT_TRUE(world->edit({{{2, 2, 0}, std::nullopt}}));
    run(*world);
    EXPECT_EQ(world->splats()->splats(), (some.cells.size() - 2) * size_t(some.points_per_voxel));
}

TEST(engine_job_world, where_all_splats_of_a_tile_do_not_fit_it_has_coarser_ones)
{
    for (const double distance : {0., 100.}) {
        WorldRequest r{.settings = *resolve_generation(options())};
        r.splat_bytes = 300 * SplatPool::kSplatBytes;
        r.detail_distance = distance;
        const auto world = *open_world(device(), std::move(r), labels_of_grid(street()));
        ASSERT_TRUE(world->focus(looking(1.8, 0)));
        run(*world);
        ASSERT_GT(world->tile({0, 0})->cells.size() * size_t(world->tile({0, 0})->points_per_voxel), 300u);
        EXPECT_TRUE(world->figures().full);
        EXPECT_EQ(world->splats()->splats() > 0, distance > 0);
    }
}

TEST(engine_job_world, without_labels_nothing_is_made_and_a_world_without_room_says_so)
{
    const auto empty = open();
    ASSERT_TRUE(empty->focus(looking(500, 10)));
    EXPECT_EQ(run(*empty), 1u);
    EXPECT_EQ(empty->figures().generated, 0u);
    EXPECT_EQ(empty->figures().finished, empty->figures().wanted);
    const auto narrow = open({}, 100 << 10);
    ASSERT_TRUE(narrow->focus(looking(4, 30)));
    run(*narrow);
    EXPECT_TRUE(narrow->figures().full);
    EXPECT_LE(narrow->figures().host_bytes, 100u << 10);
    EXPECT_GT(narrow->figures().generated, 0u);
    expect_same(*narrow, whole());
}

TEST(engine_job_world, refuses_what_cannot_be)
{
    const auto refused = [](const auto& result, ErrorCode code, const char* text) {
        ASSERT_FALSE(result);
        EXPECT_EQ(result.error().code, code);
        EXPECT_NE(result.error().message.find(text), std::string::npos) << result.error().message;
    };
    GenerationOptions o = options();
    o.tile_size = 1.2;
    refused(open_world(device(), {.settings = *resolve_generation(o)}, labels_of_grid(street())), ErrorCode::usage,
            "narrower");
    VoxelGrid fine = street();
    fine.voxel_size = 0.3f;
    refused(open_world(device(), {.settings = *resolve_generation(options())}, labels_of_grid(fine)),
            ErrorCode::bad_input, "0.3 m");
    const auto world = open();
    refused(world->focus(looking(0, -1)), ErrorCode::usage, "radius");
    refused(world->focus(looking(1e9, 1)), ErrorCode::usage, "too far");
    refused(world->focus(looking(NAN, 1)), ErrorCode::usage, "finite");
    refused(world->edit({{{0, 0, 0}, uint8_t(20)}}), ErrorCode::bad_input, "label 20");
    refused(world->edit({{{1 << 21, 0, 0}, uint8_t(0)}}), ErrorCode::bad_input, "beyond");
}

} // namespace engine_job_world_test
} // namespace semrover
