// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// worlds that are generated around a camera: the way there, budgets, caches and edits change no byte
#include "runtime/base/hash.h"
#include "tests/support/json_text.h"
#include "tests/support/world_case.h"

namespace semrover {
namespace engine_world_test {

using namespace world_case;

TEST(engine_world, every_batch_gives_the_same_bytes)
{
    for (const uint32_t batch : {1u, 5u}) {
        const VoxelGrid other = generated(street(), batch);
        EXPECT_EQ(other.points, whole().points);
        EXPECT_EQ(other.colors, whole().colors);
    }
    EXPECT_EQ(std::ranges::count(whole().generated, 1), int64_t(whole().cells.size()));
}

TEST(engine_world, a_part_with_the_neighbours_of_a_place_gives_the_bytes_of_the_whole)
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

TEST(engine_world, two_ways_to_a_place_give_the_same_bytes)
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

TEST(engine_world, a_submit_at_a_time_and_focus_between_them_change_nothing)
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

TEST(engine_world, what_is_ahead_comes_first)
{
    const auto order = [](double direction) {
        const auto world = open();
        EXPECT_TRUE(world->focus(looking(3, 12, direction)));
        std::vector<TileIndex> came;
        for (bool done = false; !done;) {
            done = *world->step(JobBudget::one_submit());
            for (const TileIndex& tile : tiles_of(*world))
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

TEST(engine_world, what_was_dropped_comes_back_with_the_same_bytes_from_the_cache_or_anew)
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
TEST(engine_world, a_cache_serves_another_session_and_no_other_world)
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

TEST(engine_world, an_edit_spoils_its_tile_and_those_that_see_it_and_can_be_taken_back)
{
    const ScratchFolder folder;
    for (const Path& cache : {Path(), folder / "cache"}) {
        const auto world = open(cache);
        ASSERT_TRUE(world->focus(looking(4, 30)));
        run(*world);
        const std::set<TileIndex> before = tiles_of(*world);
        const Cell paved = {1, 2, 0}, gone = {2, 2, 0}, added = {1, 2, 1}; // of tile (0, 0)
        ASSERT_TRUE(world->edit({{paved, uint8_t(1)}, {gone, std::nullopt}, {added, uint8_t(13)}}));
        std::set<TileIndex> left = before;
        for (const TileIndex& tile : tiles_of(*world))
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

TEST(engine_world, an_edit_while_its_tile_is_made_begins_it_again)
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

TEST(engine_world, labels_come_from_a_folder_of_tiles_and_from_a_callback_alike)
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

TEST(engine_world, an_error_of_the_source_is_told_and_the_next_step_tries_again)
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

TEST(engine_world, a_track_gives_the_bytes_of_everywhere_and_its_tiles_leave_memory)
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

TEST(engine_world, points_that_the_source_has_stay_and_are_known_around)
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

TEST(engine_world, worlds_of_two_seeds_share_a_store_and_the_last_one_is_named_by_the_index)
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

TEST(engine_world, a_store_that_cannot_be_written_is_read)
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

TEST(engine_world, tiles_whose_labels_are_not_there_yet_wait_and_no_others)
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

TEST(engine_world, a_wide_focus_over_nothing_looks_at_some_tiles_a_piece_and_keeps_none)
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

TEST(engine_world, without_labels_nothing_is_made_and_a_world_without_room_says_so)
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

TEST(engine_world, refuses_what_cannot_be)
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

} // namespace engine_world_test
} // namespace semrover
