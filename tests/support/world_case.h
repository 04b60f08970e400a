// SPDX-FileCopyrightText: semrover authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine/world/world.h"
#include "tests/support/scratch_folder.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <set>

// A street of small tiles, and worlds that generate it with a small model.
namespace semrover::world_case {

namespace fs = std::filesystem;

constexpr int32_t kEdge = 6; // voxels of a tile

inline Device& device()
{
    static const std::unique_ptr<Device> d = std::move(*Device::create({}));
    return *d;
}

inline GenerationOptions options()
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
inline VoxelGrid street(int32_t begin = -12, int32_t end = 24)
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
inline VoxelGrid generated(VoxelGrid grid, uint32_t batch = 2)
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

inline const VoxelGrid& whole()
{
    static const VoxelGrid grid = generated(street());
    return grid;
}

inline std::unique_ptr<World> open(const Path& cache = {}, uint64_t host_bytes = 0, uint32_t at_once = 1,
                                   VoxelGrid grid = street())
{
    WorldRequest r{.settings = *resolve_generation(options()), .store = cache};
    r.host_bytes = host_bytes;
    r.tiles_at_once = at_once;
    auto world = open_world(device(), std::move(r), labels_of_grid(std::move(grid)));
    EXPECT_TRUE(world) << world.error().message;
    return std::move(*world);
}

inline WorldFoci looking(double x, double radius, double direction = 1)
{
    return {{.position = {x, 1.5, 1.5}, .direction = {direction, 0, 0}, .radius = radius}};
}

inline size_t run(World& world, const JobBudget& budget = JobBudget::unlimited())
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

inline std::set<TileIndex> tiles_of(const World& world)
{
    std::set<TileIndex> tiles;
    for (int32_t x = -5; x < 8; ++x)
        for (int32_t y = -3; y < 4; ++y)
            if (world.tile({x, y}))
                tiles.insert({x, y});
    return tiles;
}

// of a tile's voxels, those with the same points as in `grid`
inline size_t same_cells(const VoxelGrid& tile, const VoxelGrid& grid)
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

inline void expect_same(const World& world, const VoxelGrid& grid)
{
    EXPECT_FALSE(tiles_of(world).empty());
    for (const TileIndex& index : tiles_of(world)) {
        const VoxelGrid& tile = *world.tile(index);
        EXPECT_EQ(same_cells(tile, grid), tile.cells.size()) << index[0] << ", " << index[1];
        EXPECT_EQ(std::ranges::count(tile.generated, 1), int64_t(tile.cells.size()));
    }
}

inline std::string tile_file(const Path& folder, const TileIndex& tile)
{
    return tile_name(tile, TileFolder::open(folder)->tiles().at(tile).key);
}

} // namespace semrover::world_case
