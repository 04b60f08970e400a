// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
// needs: device
// splats of worlds: detail, borders, edits, room
#include "tests/support/world_case.h"

namespace semrover {
namespace engine_world_splats_test {

using namespace world_case;

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
    const bool some = world.splats()->record_updates(*ring->begin());
    if (some)
        world.splats()->updates_are_submitted(device().next_point());
    EXPECT_TRUE(device().wait(*ring->submit()));
    return some;
}

// tiles are 3.6 m wide and have some 36 voxels. The tiny model's points fill space, those of streets lie on surfaces
TEST(engine_world_splats, far_tiles_have_fewer_and_larger_splats_and_all_of_them_when_they_are_near)
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

TEST(engine_world_splats, normals_at_borders_are_those_of_the_whole_street)
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
TEST(engine_world_splats, a_store_that_cannot_be_written_is_a_warning_and_no_splats_are_lost)
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

TEST(engine_world_splats, splats_from_before_an_edit_stay_until_the_new_ones_are_there)
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

TEST(engine_world_splats, without_a_model_a_world_shows_the_points_that_its_grid_has)
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

TEST(engine_world_splats, where_all_splats_of_a_tile_do_not_fit_it_has_coarser_ones)
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

} // namespace engine_world_splats_test
} // namespace semrover
